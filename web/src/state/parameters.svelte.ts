import type { ReconstructionParameters } from "../wire.gen";

/** Percent of the diagonal that the step's slider goes through, logarithmically. */
const STEP_RANGE = [0.4, 6] as const;
const DEFAULT_STEP = 1.6;
/** Smoothing lengths that the sliders go through, logarithmically, m. */
const LENGTH_RANGE = [0.001, 1] as const;
export const DEFAULT_LENGTH = 0.03;

/** What a person chose for the next reconstruction; what is automatic is left out of the request. */
export class ParametersStore {
  /** % of the estimated diagonal. */
  step = $state(DEFAULT_STEP);
  /** m; undefined: automatic. */
  prefilter = $state<number>();
  /** m; undefined: automatic. */
  stretch = $state<number>();
  /** m; undefined: automatic. */
  bend = $state<number>();
  weights = $state<ReconstructionParameters["weights"]>("auto");
  curveBias = $state<ReconstructionParameters["curve_bias"]>("auto");
  soft = $state(false);

  get request(): Partial<ReconstructionParameters> {
    return {
      step: `${Number(this.step.toPrecision(3))}%`,
      ...(this.prefilter === undefined ? {} : { prefilter: this.prefilter }),
      ...(this.stretch === undefined ? {} : { stretch: this.stretch }),
      ...(this.bend === undefined ? {} : { bend: this.bend }),
      weights: this.weights,
      curve_bias: this.curveBias,
      soft: this.soft,
    };
  }

  get isDefault(): boolean {
    const { step, prefilter, stretch, bend, weights, curveBias, soft } = this;
    const lengths = prefilter === undefined && stretch === undefined && bend === undefined;
    return step === DEFAULT_STEP && lengths && weights === "auto" && curveBias === "auto" && !soft;
  }

  reset(): void {
    this.step = DEFAULT_STEP;
    this.prefilter = this.stretch = this.bend = undefined;
    this.weights = this.curveBias = "auto";
    this.soft = false;
  }
}

/** A value on a logarithmic slider, whose handle goes from 0 to 1. */
export interface LogScale {
  toHandle(value: number): number;
  fromHandle(handle: number): number;
}

export function logScale([low, high]: readonly [number, number]): LogScale {
  const span = Math.log(high / low);
  return {
    toHandle: (value) => Math.log(value / low) / span,
    fromHandle: (handle) => Number((low * Math.exp(span * handle)).toPrecision(3)),
  };
}

export const stepScale = logScale(STEP_RANGE);
export const lengthScale = logScale(LENGTH_RANGE);
