import { fromDeviceAngles, isRotation, type Quaternion } from "../geometry/orientation";

export interface Reading {
  /** s, the device's own clock. */
  readonly time: number;
  /** Device to world (ENU). */
  readonly orientation: Quaternion;
}

export interface SensorHandlers {
  reading(reading: Reading): void;
  /** Why there are no readings, in words. */
  failed(words: string): void;
}

/** Reads the orientation until it is called. */
export type StopSensor = () => void;

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

/** What the browser lacks before it can be asked for its sensors; empty when nothing. */
export function missing(window: Window): string {
  if (!window.isSecureContext) return "Browsers give their sensors only to pages that come over HTTPS.";
  if (!("AbsoluteOrientationSensor" in window) && !("DeviceOrientationEvent" in window)) {
    return "This browser has no orientation sensor.";
  }
  return "";
}

/** Begin to read the orientation; must be called from a tap, because iOS asks the person. */
export async function startSensor(window: Window, handlers: SensorHandlers): Promise<StopSensor> {
  const failed = missing(window);
  if (failed) {
    handlers.failed(failed);
    return () => undefined;
  }
  const watched = watchSilence(handlers);
  const Sensor = (window as { AbsoluteOrientationSensor?: OrientationSensorClass }).AbsoluteOrientationSensor;
  const stop = Sensor ? startAbsolute(Sensor, watched.handlers) : await startEvents(window, watched.handlers);
  return () => {
    watched.stop();
    stop();
  };
}

function startAbsolute(Sensor: OrientationSensorClass, handlers: SensorHandlers): StopSensor {
  const sensor = new Sensor({ frequency: RATE, referenceFrame: "device" });
  sensor.addEventListener("reading", () => {
    if (!sensor.quaternion || sensor.timestamp === null) return;
    const [x, y, z, w] = sensor.quaternion;
    if (isRotation([w, x, y, z])) handlers.reading({ time: sensor.timestamp / 1000, orientation: [w, x, y, z] });
  });
  sensor.addEventListener("error", (event) => {
    const name = (event as Event & { error?: DOMException }).error?.name;
    handlers.failed(name === "NotAllowedError" ? REFUSED : "The orientation sensor does not answer.");
  });
  sensor.start();
  return () => sensor.stop();
}

async function startEvents(window: Window, handlers: SensorHandlers): Promise<StopSensor> {
  const ask = (window as unknown as { DeviceOrientationEvent: AppleOrientation }).DeviceOrientationEvent;
  if (ask.requestPermission && (await ask.requestPermission()) !== "granted") {
    handlers.failed(REFUSED);
    return () => undefined;
  }
  const name = "ondeviceorientationabsolute" in window ? "deviceorientationabsolute" : "deviceorientation";
  const listener = (event: Event): void => {
    const orientation = fromEvent(event as DeviceOrientationEvent);
    if (orientation) handlers.reading({ time: event.timeStamp / 1000, orientation });
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

/** Tell when nothing comes at all. */
function watchSilence(handlers: SensorHandlers): { handlers: SensorHandlers; stop: StopSensor } {
  const timer = setTimeout(() => handlers.failed("No orientation comes from this device's sensors."), PATIENCE);
  const stop = (): void => clearTimeout(timer);
  const reading = (value: Reading): void => {
    stop();
    handlers.reading(value);
  };
  const failed = (words: string): void => {
    stop();
    handlers.failed(words);
  };
  return { handlers: { reading, failed }, stop };
}
