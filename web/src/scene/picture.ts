import type { OverlayContent } from "../state/overlay";

/** Colours that the labels of a picture have, as CSS colours. */
export interface Inks {
  readonly ink: string;
  readonly paper: string;
  readonly accent: string;
}

const FONT = "600 11px system-ui, sans-serif";

/** Draw what lies over the 3D view into a picture, in CSS px. */
export function drawOverlay(context: OffscreenCanvasRenderingContext2D, content: OverlayContent, inks: Inks): void {
  context.font = FONT;
  context.textAlign = "center";
  context.textBaseline = "middle";
  for (const label of content.labels) {
    disc(context, label.x, label.y, 4, inks.paper, inks.ink);
    disc(context, label.labelX, label.labelY, 9, inks.paper, inks.paper);
    context.fillStyle = inks.ink;
    context.fillText(String(label.id), label.labelX, label.labelY);
  }
  const { ruler } = content;
  if (ruler) drawRuler(context, ruler, inks);
}

function drawRuler(context: OffscreenCanvasRenderingContext2D, ruler: NonNullable<OverlayContent["ruler"]>, inks: Inks): void {
  const [from, to] = [ruler.from, ruler.to];
  context.strokeStyle = inks.accent;
  context.lineWidth = 2;
  context.beginPath();
  context.moveTo(from.x, from.y);
  context.lineTo(to.x, to.y);
  context.stroke();
  context.fillStyle = inks.ink;
  context.fillText(ruler.text, (from.x + to.x) / 2, (from.y + to.y) / 2 - 12);
}

function disc(context: OffscreenCanvasRenderingContext2D, x: number, y: number, radius: number, fill: string, line: string): void {
  context.beginPath();
  context.arc(x, y, radius, 0, 2 * Math.PI);
  context.fillStyle = fill;
  context.fill();
  context.strokeStyle = line;
  context.lineWidth = 2;
  context.stroke();
}
