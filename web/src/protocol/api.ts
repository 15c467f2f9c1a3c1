import type {
  Calibration,
  Comparison,
  ComparisonFailure,
  ComparisonProgress,
  Curve,
  CurveUpdate,
  LiveReading,
  NetworkProblems,
  NewToken,
  NodeProposals,
  Outline,
  Preview,
  PreviewWish,
  Problem,
  Reconstruction,
  ReconstructionParameters,
  RecordingSummary,
  Rights,
  Session,
  Token,
  TokenCreate,
} from "../wire.gen";
import { jsonLines } from "./lines";

/** An answer of the server that is not a success, in its own words. */
export class ApiProblem extends Error {
  constructor(
    readonly status: number,
    readonly title: string,
    readonly detail: string,
  ) {
    super(detail || title);
    this.name = "ApiProblem";
  }
}

/** An error in words for the person in front of the screen. */
export function inWords(error: unknown): string {
  if (error instanceof ApiProblem) return error.message;
  if (error instanceof TypeError) return "The server does not answer. Is it running?";
  return error instanceof Error ? error.message : String(error);
}

type Body = string | Blob;

/** As many things as the server lists at once. */
const PAGE = 500;

/** The REST API of the server that sent this page. */
export class Api {
  constructor(
    private readonly base = "/api/v1",
    private readonly fetcher: typeof fetch = (input, init) => fetch(input, init),
  ) {}

  /** What this browser may do. */
  rights(): Promise<Rights> {
    return this.#json<Rights>("GET", "/rights");
  }

  tokens(session: string): Promise<Token[]> {
    return this.#json<Token[]>("GET", `/tokens?session=${session}`);
  }

  createToken(wanted: Partial<TokenCreate>): Promise<NewToken> {
    return this.#json<NewToken>("POST", "/tokens", JSON.stringify(wanted));
  }

  async revokeToken(id: string): Promise<void> {
    await this.#request("DELETE", `/tokens/${id}`);
  }

  sessions(): Promise<Session[]> {
    return this.#json<Session[]>("GET", `/sessions?limit=${PAGE}`);
  }

  session(id: string): Promise<Session> {
    return this.#json<Session>("GET", `/sessions/${id}`);
  }

  createSession(name: string): Promise<Session> {
    return this.#json<Session>("POST", "/sessions", JSON.stringify({ name }));
  }

  renameSession(id: string, name: string): Promise<Session> {
    return this.#json<Session>("PATCH", `/sessions/${id}`, JSON.stringify({ name }));
  }

  async deleteSession(id: string): Promise<void> {
    await this.#request("DELETE", `/sessions/${id}`);
  }

  curves(session: string): Promise<Curve[]> {
    return this.#all<Curve>(`/sessions/${session}/curves`);
  }

  updateCurve(session: string, index: number, change: Partial<CurveUpdate>): Promise<Curve> {
    return this.#json<Curve>("PATCH", `/sessions/${session}/curves/${index}`, JSON.stringify(change));
  }

  recordings(session: string): Promise<RecordingSummary[]> {
    return this.#all<RecordingSummary>(`/sessions/${session}/recordings`);
  }

  /** Have a recording corrected by a calibration of its device, or by none. */
  calibrate(session: string, recording: string, version: number | null): Promise<RecordingSummary> {
    const path = `/sessions/${session}/recordings/${recording}`;
    return this.#json<RecordingSummary>("PATCH", path, JSON.stringify({ calibration: version }));
  }

  /** Of a device, newest first. */
  calibrations(device: string): Promise<Calibration[]> {
    return this.#json<Calibration[]>("GET", `/devices/${device}/calibrations`);
  }

  /** Take in a rawnet or a recording as if a device had sent it. */
  async upload(session: string, file: Blob): Promise<RecordingSummary> {
    const path = `/sessions/${session}/recordings`;
    return (await (await this.#request("POST", path, file, "application/octet-stream")).json()) as RecordingSummary;
  }

  /** Take in a network JSON; the job spans its surface. */
  openNetwork(session: string, file: Blob): Promise<Reconstruction> {
    return this.#json<Reconstruction>("POST", `/sessions/${session}/networks`, file);
  }

  /** What a session looks like, in few points. */
  outline(session: string): Promise<Outline> {
    return this.#json<Outline>("GET", `/sessions/${session}/outline`);
  }

  reconstruct(session: string, parameters: Partial<ReconstructionParameters>): Promise<Reconstruction> {
    return this.#json<Reconstruction>("POST", `/sessions/${session}/reconstructions`, JSON.stringify(parameters));
  }

  /** The network with these parameters and marks, at once; refused (409) when the same client asked again meanwhile. */
  preview(session: string, client: string, wish: Partial<PreviewWish>): Promise<Preview> {
    return this.#json<Preview>("POST", `/sessions/${session}/preview?client=${client}`, JSON.stringify(wish));
  }

  /** The network of one reading of a fixed array. */
  reading(session: string, number: number): Promise<LiveReading> {
    return this.#json<LiveReading>("GET", `/sessions/${session}/readings/${number}`);
  }

  proposals(session: string): Promise<NodeProposals> {
    return this.#json<NodeProposals>("GET", `/sessions/${session}/node-proposals`);
  }

  problems(session: string): Promise<NetworkProblems> {
    return this.#json<NetworkProblems>("GET", `/sessions/${session}/problems`);
  }

  reconstruction(id: string): Promise<Reconstruction> {
    return this.#json<Reconstruction>("GET", `/reconstructions/${id}`);
  }

  /** How far a reconstructed surface is from the true mesh in a file: progress, again and again, then the end. */
  async *compare(
    reconstruction: string,
    truth: File,
    align: string,
    signal: AbortSignal,
  ): AsyncGenerator<ComparisonProgress | Comparison | ComparisonFailure> {
    const query = new URLSearchParams({ truth: truth.name, align });
    const url = `${this.base}/reconstructions/${reconstruction}/comparison?${query}`;
    const headers = { "content-type": "application/octet-stream" };
    yield* jsonLines(await this.#check(await this.fetcher(url, { method: "POST", body: truth, headers, signal })));
  }

  cancel(reconstruction: string): Promise<Reconstruction> {
    return this.#json<Reconstruction>("POST", `/reconstructions/${reconstruction}/cancel`);
  }

  /** A JSON artifact by its URL. */
  async artifact<T>(url: string): Promise<T> {
    return (await (await this.#check(await this.fetcher(url))).json()) as T;
  }

  /** Every page of a list. */
  async #all<T>(path: string): Promise<T[]> {
    const found: T[] = [];
    let next: string | undefined = `${path}?limit=${PAGE}`;
    while (next !== undefined) {
      const page = await this.#request("GET", next);
      found.push(...((await page.json()) as T[]));
      next = /<([^>]+)>; rel="next"/.exec(page.headers.get("link") ?? "")?.[1]?.slice(this.base.length);
    }
    return found;
  }

  async #json<T>(method: string, path: string, body?: Body): Promise<T> {
    return (await (await this.#request(method, path, body)).json()) as T;
  }

  async #request(method: string, path: string, body?: Body, type = "application/json"): Promise<Response> {
    const init: RequestInit = { method };
    if (body !== undefined) Object.assign(init, { body, headers: { "content-type": type } });
    return this.#check(await this.fetcher(this.base + path, init));
  }

  async #check(response: Response): Promise<Response> {
    if (response.ok) return response;
    const problem = (await response.json().catch(() => ({}))) as Partial<Problem>;
    const title = problem.title ?? `${response.status} ${response.statusText}`;
    throw new ApiProblem(response.status, title, problem.detail ?? "");
  }
}
