import { continued, fromDeviceAngles, isRotation, type Quaternion } from "../geometry/orientation";
import { REFERENCE, type SourceHandlers, type Source, type StopSource } from "./source";

interface Orientation {
  readonly time: number;
  readonly quaternion: Quaternion;
}

interface OrientationHandlers {
  reading(orientation: Orientation): void;
  failed(words: string): void;
}

interface OrientationSensor extends EventTarget {
  readonly quaternion: readonly [number, number, number, number] | null;
  readonly timestamp: number | null;
  start(): void;
  stop(): void;
}

type OrientationSensorClass = new (options: { frequency: number; referenceFrame: "device" }) => OrientationSensor;

/** iOS: the events come only after a question, and the compass is apart from the angles. */
interface AppleOrientation {
  requestPermission?: () => Promise<"granted" | "denied">;
}

const RATE = 60;
const PATIENCE = 2500;
const REFUSED = "This page may not read the motion sensors. Allow them for this site in the browser's settings.";

/** The orientation sensor of the device that shows this page: top edge forward, screen away from the surface. */
export const motionSensors: Source = {
  kind: "phone",
  label: "Use this device's sensors",
  hint: "Lay the phone on the surface, screen outwards, and lead it along the curve with its top edge first.",
  device: {
    kind: "phone",
    name: "phone",
    wheel: null,
    mounting: [0.5, 0.5, 0.5, 0.5],
    reference: REFERENCE,
    calibration: null,
    array: null,
  },
  missing,
  start: startSensor,
};

/** What the browser lacks before it can be asked for its sensors; empty when nothing. */
function missing(window: Window): string {
  if (!window.isSecureContext) return "Browsers give their sensors only to pages that come over HTTPS.";
  if (!("AbsoluteOrientationSensor" in window) && !("DeviceOrientationEvent" in window)) {
    return "This browser has no orientation sensor.";
  }
  return "";
}

/** Begin to read the orientation; must be called from a tap, because iOS asks the person. */
async function startSensor(window: Window, handlers: SourceHandlers): Promise<StopSource> {
  const watched = watchSilence(handlers);
  const Sensor = (window as { AbsoluteOrientationSensor?: OrientationSensorClass }).AbsoluteOrientationSensor;
  const stop = Sensor ? startAbsolute(Sensor, watched.handlers) : await startEvents(window, watched.handlers);
  return () => {
    watched.stop();
    stop();
  };
}

function startAbsolute(Sensor: OrientationSensorClass, handlers: OrientationHandlers): StopSource {
  const sensor = new Sensor({ frequency: RATE, referenceFrame: "device" });
  sensor.addEventListener("reading", () => {
    if (!sensor.quaternion || sensor.timestamp === null) return;
    const [x, y, z, w] = sensor.quaternion;
    if (isRotation([w, x, y, z])) handlers.reading({ time: sensor.timestamp / 1000, quaternion: [w, x, y, z] });
  });
  sensor.addEventListener("error", (event) => {
    const name = (event as Event & { error?: DOMException }).error?.name;
    handlers.failed(name === "NotAllowedError" ? REFUSED : "The orientation sensor does not answer.");
  });
  sensor.start();
  return () => sensor.stop();
}

async function startEvents(window: Window, handlers: OrientationHandlers): Promise<StopSource> {
  const ask = (window as unknown as { DeviceOrientationEvent: AppleOrientation }).DeviceOrientationEvent;
  if (ask.requestPermission && (await ask.requestPermission()) !== "granted") {
    handlers.failed(REFUSED);
    return () => undefined;
  }
  const name = "ondeviceorientationabsolute" in window ? "deviceorientationabsolute" : "deviceorientation";
  const listener = (event: Event): void => {
    const quaternion = fromEvent(event as DeviceOrientationEvent);
    if (quaternion) handlers.reading({ time: event.timeStamp / 1000, quaternion });
  };
  window.addEventListener(name, listener);
  return () => window.removeEventListener(name, listener);
}

/** Orientation of an event; iOS tells the heading clockwise from North in a field of its own. */
function fromEvent(event: DeviceOrientationEvent & { webkitCompassHeading?: number }): Quaternion | undefined {
  const { beta, gamma } = event;
  const alpha = event.webkitCompassHeading === undefined ? event.alpha : 360 - event.webkitCompassHeading;
  return alpha === null || beta === null || gamma === null ? undefined : fromDeviceAngles(alpha, beta, gamma);
}

/** Tell when nothing comes at all; leave no jumps of sign. */
function watchSilence(handlers: SourceHandlers): { handlers: OrientationHandlers; stop: StopSource } {
  const timer = setTimeout(() => handlers.failed("No orientation comes from this device's sensors."), PATIENCE);
  const stop = (): void => clearTimeout(timer);
  let before: Quaternion | undefined;
  const reading = ({ time, quaternion }: Orientation): void => {
    stop();
    before = continued(quaternion, before);
    handlers.reading({ time, quaternion: before });
  };
  const failed = (words: string): void => {
    stop();
    handlers.failed(words);
  };
  return { handlers: { reading, failed }, stop };
}
