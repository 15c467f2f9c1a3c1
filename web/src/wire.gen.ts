/* Generated from the server's models by `npm run wire`; do not edit. */

/**
 * Every message up to and including `seq` is committed to durable storage.
 */
export interface Ack {
  seq: number;
  type: "ack";
}
/**
 * Sensors in a row along one curve.
 */
export interface ArrayCurve {
  /**
   * the curve bounds the surface
   */
  boundary: boolean;
  /**
   * the last sensor is followed by the first
   */
  closed: boolean;
  /**
   * [w, x, y, z]: turns this curve's axes (tangent, normal, B) into a sensor's own axes, after which the device's mounting does; one for all of its sensors, or one for each
   */
  mounting: [number, number, number, number][];
  /**
   * in their order along the curve, none twice
   */
  sensors: number[];
  /**
   * m along the curve from each sensor to the next; of a closed curve also from the last to the first
   */
  spacing: number[];
}
/**
 * What all sensors of an array measured at one time; every column has one row per sensor.
 *
 * The message's own number, `seq`, is the reading's: an array's recording consists of nothing else.
 */
export interface ArrayReading {
  /**
   * sensor axes, up at rest; any unit
   */
  acceleration: [number, number, number][] | null;
  /**
   * sensor axes; any unit
   */
  magnetic: [number, number, number][] | null;
  /**
   * [w, x, y, z], sensor to ENU
   */
  quaternion: [number, number, number, number][] | null;
  /**
   * s since 1970 UTC, when the bridge had the reading
   */
  received: number | null;
  seq: number;
  /**
   * s, the device's own clock
   */
  time: number;
  type: "reading";
}
/**
 * Many scans that were sent at once, each with a reconstruction of its own; and how many are in which state.
 */
export interface Batch {
  cancelled: number;
  created: string;
  done: number;
  failed: number;
  /**
   * of all its work
   */
  fraction: number;
  id: string;
  name: string;
  queued: number;
  running: number;
  /**
   * scans; those that no state counts are being taken in, or their session was deleted
   */
  size: number;
}
/**
 * One calibration of one device.
 */
export interface Calibration {
  accelerometer: SensorCorrection | null;
  /**
   * [w, x, y, z]: turns the magnetometer's corrected vectors into the accelerometer's axes
   *
   * @minItems 4
   * @maxItems 4
   */
  alignment: [number, number, number, number];
  /**
   * of the wheel, m
   */
  circumference: number | null;
  device: string;
  /**
   * rad, of the field below the horizontal, as corrected
   */
  dip: number | null;
  dip_spread_after: number | null;
  /**
   * rad, standard deviation over all poses
   */
  dip_spread_before: number | null;
  format: "tracemesh-calibration";
  made: string;
  magnetometer: SensorCorrection | null;
  /**
   * where, for people
   */
  place: string;
  /**
   * which readings it was made of, for people
   */
  source: string;
  /**
   * none: no server has it yet
   */
  version: number | null;
}
/**
 * Right vector = matrix (measured - offset), both in the sensor's own unit.
 */
export interface SensorCorrection {
  /**
   * part of all directions in which it was measured
   */
  coverage: number;
  /**
   * rows; determinant about 1
   *
   * @minItems 3
   * @maxItems 3
   */
  matrix: [[number, number, number], [number, number, number], [number, number, number]];
  /**
   * @minItems 3
   * @maxItems 3
   */
  offset: [number, number, number];
  spread_after: number;
  /**
   * standard deviation of the vectors' lengths over their mean
   */
  spread_before: number;
}
/**
 * POST /devices/{device}/calibrations: one that is ready, or readings of which the server makes one.
 */
export interface CalibrationCreate {
  calibration: Calibration | null;
  /**
   * of the device, if the server does not know it yet
   */
  kind: string;
  readings: CalibrationReadings | null;
}
/**
 * What a calibration is made of: poses all around, faces that the device lay on, a straight run; any of the first
 * and the last.
 */
export interface CalibrationReadings {
  /**
   * as measured, up at rest
   */
  acceleration: [number, number, number][];
  /**
   * accelerations at rest on faces of the case, one for each
   */
  faces: [number, number, number][];
  /**
   * none: now
   */
  made: string | null;
  /**
   * as measured, one for each of these
   */
  magnetic: [number, number, number][];
  place: string;
  run: StraightRun | null;
  source: string;
}
/**
 * A straight run whose length a ruler measured.
 */
export interface StraightRun {
  /**
   * m
   */
  length: number;
  ticks: [number, number][];
  ticks_per_turn: number;
}
/**
 * Its last line: how far the surface is from a true one, in % of the truth's diagonal unless it says otherwise.
 */
export interface Comparison {
  /**
   * m, of the truth's bounding box
   */
  diagonal: number;
  max: number;
  mean: number;
  min: number;
  /**
   * mean angle to the true normals, degrees
   */
  normal_deg: number | null;
  rms: number;
  /**
   * rows; a vertex x was placed at scale * rotation x + translation
   */
  rotation: [number, number, number][];
  scale: number;
  /**
   * m, of every vertex of mesh.glb; negative inside the truth
   */
  signed_distance: number[];
  /**
   * m
   *
   * @minItems 3
   * @maxItems 3
   */
  translation: [number, number, number];
  type: "comparison";
}
/**
 * Its last line when it could not be done.
 */
export interface ComparisonFailure {
  detail: string;
  type: "failure";
}
/**
 * A line of the answer to POST /reconstructions/{reconstruction}/comparison while it is worked on.
 */
export interface ComparisonProgress {
  fraction: number;
  stage: string;
  type: "progress";
}
/**
 * One scanned curve of a session.
 */
export interface Curve {
  boundary: boolean;
  closed: boolean;
  ended: boolean;
  /**
   * number within the session, in order of scanning
   */
  index: number;
  /**
   * m, as the odometer saw it
   */
  length: number;
  /**
   * of segments; used while both ends are marked, or are those of a curve without marks
   */
  lengths: MeasuredLength[];
  marks: Mark[];
  recording: string;
  samples: number;
}
/**
 * A length of a curve between two of its samples that somebody measured.
 */
export interface MeasuredLength {
  /**
   * sample that it is measured from
   */
  first: number;
  /**
   * sample that it is measured to; over the end of a closed curve where it is before
   */
  last: number;
  /**
   * m
   */
  length: number;
}
/**
 * A node marked on a curve.
 */
export interface Mark {
  node: number;
  sample: number;
}
/**
 * A change of one curve, to be made with PATCH.
 */
export interface CurveEdit {
  change: CurveUpdate;
  /**
   * index within the session
   */
  curve: number;
}
/**
 * PATCH /sessions/{session}/curves/{index}; absent fields stay.
 */
export interface CurveUpdate {
  boundary: boolean | null;
  closed: boolean | null;
  /**
   * replace all measured lengths of the curve
   */
  lengths: MeasuredLength[] | null;
  /**
   * replace all marks of the curve
   */
  marks: Mark[] | null;
  /**
   * left out of everything; its samples stay stored
   */
  removed: boolean | null;
}
/**
 * A curve ends.
 */
export interface CurveEnd {
  /**
   * the curve ends where it began
   */
  closed: boolean;
  curve: number;
  /**
   * the curve was a mistake: kept as sent, left out of the scan
   */
  discard: boolean;
  seq: number;
  type: "curve.end";
}
/**
 * Marks of one curve.
 */
export interface CurveMarks {
  /**
   * index within the session
   */
  curve: number;
  marks: Mark[];
}
/**
 * A curve begins; its samples and nodes refer to its number.
 */
export interface CurveStart {
  /**
   * the curve bounds the surface
   */
  boundary: boolean;
  /**
   * number of the curve within the recording: 0, 1, 2, ...
   */
  curve: number;
  seq: number;
  type: "curve.start";
}
/**
 * Who measures, and what is needed to read its numbers.
 */
export interface Device {
  /**
   * present when the device is a fixed array of sensors
   */
  array: SensorArray | null;
  /**
   * of this device, chosen by whoever records; the readings are as measured all the same
   */
  calibration: Calibration | null;
  id: string;
  /**
   * morphorider, phone, sensorserver, file, ...
   */
  kind: string;
  /**
   * [w, x, y, z]: turns the axes (tangent, normal, B) into the device's own axes
   *
   * @minItems 4
   * @maxItems 4
   */
  mounting: [number, number, number, number];
  name: string;
  reference: Reference;
  /**
   * present when the device counts wheel ticks
   */
  wheel: Wheel | null;
}
/**
 * Which sensors are where along which curves.
 */
export interface SensorArray {
  curves: ArrayCurve[];
}
/**
 * Directions in the world (ENU) that the accelerometer and the magnetometer see at rest.
 */
export interface Reference {
  /**
   * @minItems 3
   * @maxItems 3
   */
  acceleration: [number, number, number];
  /**
   * @minItems 3
   * @maxItems 3
   */
  magnetic: [number, number, number];
}
/**
 * An odometer wheel: distance = (big + small / ticks_per_turn) * circumference.
 */
export interface Wheel {
  /**
   * m, travelled in one turn
   */
  circumference: number;
  /**
   * m along (tangent, normal, B): where it measures, from the point of the surface under the sensors
   *
   * @minItems 3
   * @maxItems 3
   */
  offset: [number, number, number];
  ticks_per_turn: number;
}
/**
 * Why the server closes the connection.
 */
export interface ErrorMessage {
  code: "version" | "malformed" | "gap" | "limit" | "forbidden" | "storage" | "unknown";
  /**
   * with `gap`: the number that was wanted
   */
  expected_seq: number | null;
  message: string;
  type: "error";
}
/**
 * What would mend a problem.
 */
export interface Fix {
  /**
   * none: look for nodes that nobody marked
   */
  changes: CurveEdit[];
  /**
   * in words, for a button
   */
  label: string;
}
/**
 * First message of every connection and first line of every recording.
 */
export interface Hello {
  device: Device;
  /**
   * chosen by the device, kept in its spool, the same after a restart
   */
  recording: string;
  /**
   * session to record into; none: the server makes one
   */
  session: string | null;
  type: "hello";
  versions: number[];
}
/**
 * A device that has sent something to this server.
 */
export interface KnownDevice {
  /**
   * how many of its calibrations are stored
   */
  calibrations: number;
  first_seen: string;
  id: string;
  kind: string;
  /**
   * when it last began or went on with a recording, or was calibrated
   */
  last_seen: string;
  name: string;
}
/**
 * One curve as drawn: dead reckoning while it is scanned, consistent once the network was solved.
 */
export interface LiveCurve {
  boundary: boolean;
  closed: boolean;
  ended: boolean;
  index: number;
  positions: number[];
  /**
   * for each point, the sample of the curve that it is at
   */
  samples: number[];
}
/**
 * A curve ends.
 */
export interface LiveCurveEnd {
  closed: boolean;
  index: number;
  type: "live.curve.end";
}
/**
 * A curve begins.
 */
export interface LiveCurveStart {
  boundary: boolean;
  index: number;
  type: "live.curve.start";
}
/**
 * Health of a device that records into the session.
 */
export interface LiveDevice {
  /**
   * mean of |acceleration|, the device's own unit
   */
  acceleration_norm: number | null;
  /**
   * s since the last sample arrived
   */
  age: number;
  /**
   * rad, angle of the field below the horizontal
   */
  dip: number | null;
  /**
   * s, standard deviation of the time between its last samples
   */
  jitter: number | null;
  kind: string;
  /**
   * mean of |magnetic|, the device's own unit
   */
  magnetic_norm: number | null;
  name: string;
  /**
   * samples, or readings of an array, per second, over the last second
   */
  rate: number;
  recording: string;
  state: "live" | "stale" | "lost";
  type: "live.device";
}
/**
 * All curves and nodes after the network was solved again; replaces everything drawn before.
 */
export interface LiveNetwork {
  curves: LiveCurve[];
  nodes: NodePosition[];
  type: "live.network";
}
/**
 * Where a node is, as far as known.
 */
export interface NodePosition {
  node: number;
  /**
   * @minItems 3
   * @maxItems 3
   */
  position: [number, number, number];
}
/**
 * A node was marked.
 */
export interface LiveNode {
  /**
   * curve
   */
  index: number;
  node: NodePosition;
  type: "live.node";
}
/**
 * New points at the end of a curve.
 */
export interface LivePoints {
  /**
   * number of the first of these points within the curve as drawn
   */
  first: number;
  index: number;
  positions: number[];
  /**
   * for each point, the sample of the curve that it is at
   */
  samples: number[];
  type: "live.points";
}
/**
 * The network of one reading of a fixed array; a newer one of the same recording replaces it.
 *
 * Its curves are numbered as in the array's declaration, its nodes as their sensors.
 */
export interface LiveReading {
  curves: LiveCurve[];
  nodes: NodePosition[];
  /**
   * of the reading within the session
   */
  number: number;
  recording: string;
  /**
   * s, the device's own clock
   */
  time: number;
  type: "live.reading";
}
/**
 * A reconstruction was created, made progress, or ended.
 */
export interface LiveReconstruction {
  reconstruction: Reconstruction;
  type: "live.reconstruction";
}
/**
 * A reconstruction of a session: a job, and its results once it is done.
 */
export interface Reconstruction {
  /**
   * file name -> URL: network.json, mesh.glb, report.json
   */
  artifacts: {
    [k: string]: string;
  };
  /**
   * it was sent with others, and comes after what is waited for
   */
  batch: string | null;
  created: string;
  /**
   * why it failed, in words for people
   */
  error: string | null;
  finished: string | null;
  fraction: number;
  id: string;
  parameters: ReconstructionParameters;
  session: string;
  /**
   * what is being done, in words
   */
  stage: string;
  state: "queued" | "running" | "done" | "failed" | "cancelled";
}
/**
 * What a person may choose; everything left out is chosen automatically and reported.
 */
export interface ReconstructionParameters {
  /**
   * smoothing length of the bend term, m
   */
  bend: number | null;
  curve_bias: "auto" | "on" | "off";
  /**
   * find the nodes that are not marked; those marked already are kept
   */
  infer_nodes: boolean;
  /**
   * distance of the surface's vertices: % of the estimated diagonal, or m; none: as its points
   */
  mesh_size: string | null;
  /**
   * standard deviation of the Gaussian with which scanned frames are resampled, m; none: half a step
   */
  prefilter: number | null;
  /**
   * of a fixed array: number of the reading within the session; none: the last one
   */
  reading: number | null;
  /**
   * bear several percent of frames that are pure chance
   */
  robust: boolean;
  /**
   * let the surface leave a noisy network a little
   */
  soft: boolean;
  /**
   * distance of the network's points: % of the estimated diagonal, or m
   */
  step: string;
  /**
   * smoothing length of the stretch term, m
   */
  stretch: number | null;
  /**
   * also span the surface, not only the network
   */
  surface: boolean;
  weights: "auto" | "thesis";
}
/**
 * Somebody joined or left: how many sockets watch the session on this server, the receiver's own included.
 *
 * Those that watch the same session through another server are not counted.
 */
export interface LiveWatchers {
  count: number;
  type: "live.watchers";
}
/**
 * A node of the latest network of a session.
 */
export interface NetworkNode {
  index: number;
  /**
   * unit, outward
   *
   * @minItems 3
   * @maxItems 3
   */
  normal: [number, number, number];
  /**
   * m, world
   *
   * @minItems 3
   * @maxItems 3
   */
  position: [number, number, number];
  /**
   * indices of those that begin or end here
   */
  segments: number[];
}
/**
 * What keeps a session's curves from being a network with a surface, or what a person should know of it.
 */
export interface NetworkProblem {
  /**
   * indices of the curves that it is about
   */
  curves: number[];
  fix: Fix | null;
  message: string;
  /**
   * from where to where on the first of them
   */
  samples: [number, number] | null;
  severity: "error" | "warning";
}
/**
 * GET /sessions/{session}/problems.
 */
export interface NetworkProblems {
  problems: NetworkProblem[];
}
/**
 * A piece of a curve between two nodes of the latest network of a session.
 */
export interface NetworkSegment {
  boundary: boolean;
  /**
   * number of its curve among those that were reconstructed
   */
  curve: number;
  index: number;
  /**
   * m
   */
  length: number;
  /**
   * indices of the nodes at its ends; a closed curve that meets none has none
   */
  nodes: number[];
  points: number;
}
/**
 * A token that was just made; nobody is told its secret again.
 */
export interface NewToken {
  created: string;
  expires: string | null;
  id: string;
  /**
   * to about a minute
   */
  last_used: string | null;
  name: string;
  role: "viewer" | "device" | "owner";
  session: string | null;
  token: string;
}
/**
 * A node was marked at a sample of a curve; nodes with the same number are the same point of the object.
 */
export interface NodeMark {
  curve: number;
  node: number;
  /**
   * number of the sample within its curve
   */
  sample: number;
  seq: number;
  type: "node";
  /**
   * takes back the mark of this node at this sample: it was a mistake
   */
  undo: boolean;
}
/**
 * Where a node is on one of its curves.
 */
export interface NodePlace {
  /**
   * index within the session
   */
  curve: number;
  sample: number;
}
/**
 * A node that was found, or one marked already; accepted by marking its places with PATCH on their curves.
 */
export interface NodeProposal {
  confidence: number;
  /**
   * its number, if it is marked already
   */
  node: number | null;
  places: NodePlace[];
}
/**
 * GET /sessions/{session}/node-proposals.
 */
export interface NodeProposals {
  proposals: NodeProposal[];
  /**
   * curves of which nothing is known: no place was found for them
   */
  unplaced: number[];
}
/**
 * GET /sessions/{session}/outline: what it looks like, in few points; for a list of many sessions.
 */
export interface Outline {
  curves: OutlineCurve[];
}
/**
 * One line of an outline.
 */
export interface OutlineCurve {
  boundary: boolean;
  /**
   * m, world: [x0, y0, z0, x1, ...]
   */
  positions: number[];
}
/**
 * Answer to POST /sessions/{session}/preview: the network that these parameters give, without its surface.
 */
export interface Preview {
  curves: LiveCurve[];
  nodes: NodePosition[];
  /**
   * what was chosen and found, as in report.json
   */
  report: {
    [k: string]: unknown;
  };
}
/**
 * POST /sessions/{session}/preview.
 */
export interface PreviewWish {
  /**
   * smoothing length of the bend term, m
   */
  bend: number | null;
  curve_bias: "auto" | "on" | "off";
  /**
   * find the nodes that are not marked; those marked already are kept
   */
  infer_nodes: boolean;
  /**
   * tried out instead of the marks that these curves have
   */
  marks: CurveMarks[];
  /**
   * distance of the surface's vertices: % of the estimated diagonal, or m; none: as its points
   */
  mesh_size: string | null;
  /**
   * standard deviation of the Gaussian with which scanned frames are resampled, m; none: half a step
   */
  prefilter: number | null;
  /**
   * of a fixed array: number of the reading within the session; none: the last one
   */
  reading: number | null;
  /**
   * bear several percent of frames that are pure chance
   */
  robust: boolean;
  /**
   * let the surface leave a noisy network a little
   */
  soft: boolean;
  /**
   * distance of the network's points: % of the estimated diagonal, or m
   */
  step: string;
  /**
   * smoothing length of the stretch term, m
   */
  stretch: number | null;
  /**
   * also span the surface, not only the network
   */
  surface: boolean;
  weights: "auto" | "thesis";
}
/**
 * RFC 9457 problem details: the one error envelope of the API.
 */
export interface Problem {
  detail: string;
  /**
   * per field: where, what was wanted, what came
   */
  errors: {
    [k: string]: unknown;
  }[];
  instance: string;
  status: number;
  title: string;
  type: string;
}
/**
 * GET /sessions/{session}/readings: when the readings of fixed arrays were taken.
 */
export interface Readings {
  /**
   * of all readings of the session; they are numbered 0, 1, 2, ...
   */
  count: number;
  /**
   * number of the reading to which the first of `times` belongs
   */
  first: number;
  /**
   * s, the device's own clock
   */
  times: number[];
}
/**
 * A recording of a session: what one device sent, or one uploaded file.
 */
export interface RecordingSummary {
  bytes: number;
  /**
   * of its device, applied when it is reconstructed
   */
  calibration: number | null;
  created: string;
  device: Device;
  id: string;
  messages: number;
  session: string;
}
/**
 * PATCH /sessions/{session}/recordings/{recording}; absent fields stay.
 */
export interface RecordingUpdate {
  /**
   * version of its device's calibration; null: none
   */
  calibration: number | null;
}
/**
 * Directions in the world (ENU) that the accelerometer and the magnetometer see at rest.
 */
export interface Reference1 {
  /**
   * @minItems 3
   * @maxItems 3
   */
  acceleration: [number, number, number];
  /**
   * @minItems 3
   * @maxItems 3
   */
  magnetic: [number, number, number];
}
/**
 * GET /rights: what whoever asks may do.
 */
export interface Rights {
  /**
   * the server demands a token: who is to come in needs one
   */
  closed: boolean;
  expires: string | null;
  role: "viewer" | "device" | "owner";
  /**
   * only here; none: everywhere on the server
   */
  session: string | null;
}
/**
 * A block of samples; every column that is present has one entry per sample.
 *
 * Orientation comes as `acceleration` and `magnetic`, or as `quaternion`, or as `tangent` and `normal`; distance as
 * `ticks` or `distance`, or not at all (then constant speed along each segment is assumed).
 */
export interface Samples {
  /**
   * device axes, up at rest; any unit
   */
  acceleration: [number, number, number][] | null;
  curve: number;
  /**
   * m along the curve
   */
  distance: number[] | null;
  /**
   * number of the block's first sample within its curve
   */
  first_sample: number;
  /**
   * device axes; any unit
   */
  magnetic: [number, number, number][] | null;
  /**
   * unit, outward, world (ENU)
   */
  normal: [number, number, number][] | null;
  /**
   * [w, x, y, z], device to ENU
   */
  quaternion: [number, number, number, number][] | null;
  /**
   * s since 1970 UTC, when the bridge had the sample
   */
  received: number[] | null;
  /**
   * rad/s, device axes
   */
  rotation_rate: [number, number, number][] | null;
  seq: number;
  /**
   * unit, world (ENU)
   */
  tangent: [number, number, number][] | null;
  /**
   * wheel: [big (turns), small]
   */
  ticks: [number, number][] | null;
  /**
   * s, the device's own clock
   */
  time: number[] | null;
  type: "samples";
}
/**
 * One object being scanned.
 */
export interface Session {
  created: string;
  curves: number;
  id: string;
  /**
   * newest one that is done
   */
  latest_reconstruction: string | null;
  name: string;
  /**
   * distinct node numbers marked
   */
  nodes: number;
  /**
   * of fixed arrays
   */
  readings: number;
  samples: number;
}
/**
 * POST /sessions.
 */
export interface SessionCreate {
  /**
   * chosen by the caller; none: the server chooses
   */
  id: string | null;
  name: string;
}
/**
 * PATCH /sessions/{session}; absent fields stay.
 */
export interface SessionUpdate {
  name: string | null;
}
/**
 * Everything a late joiner needs.
 */
export interface Snapshot {
  curves: LiveCurve[];
  devices: LiveDevice[];
  nodes: NodePosition[];
  /**
   * the newest one of every array that has one
   */
  readings: LiveReading[];
  reconstruction: Reconstruction | null;
  session: string;
  type: "live.snapshot";
  /**
   * as in live.watchers
   */
  watchers: number;
}
/**
 * A token, without its secret.
 */
export interface Token {
  created: string;
  expires: string | null;
  id: string;
  /**
   * to about a minute
   */
  last_used: string | null;
  name: string;
  role: "viewer" | "device" | "owner";
  session: string | null;
}
/**
 * POST /tokens.
 */
export interface TokenCreate {
  /**
   * s from now; none: until it is revoked
   */
  expires_in: number | null;
  /**
   * who or what it is for
   */
  name: string;
  role: "viewer" | "device" | "owner";
  /**
   * the only session that it opens; none: the server
   */
  session: string | null;
}
/**
 * The server's answer to hello.
 */
export interface Welcome {
  /**
   * the newest one of this device that the server has and the recording does not use
   */
  calibration: string | null;
  /**
   * number of the first message that the server does not have
   */
  next_seq: number;
  session: string;
  type: "welcome";
  version: number;
}
