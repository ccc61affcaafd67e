/**
 * The WebSocket to the program. Where it breaks, it is opened again.
 */

/** Seconds before the first new try, and the most between two. */
const FIRST_WAIT = 1;
const LONGEST_WAIT = 5;

export class Connection {
  #wait = FIRST_WAIT;
  /** @type {WebSocket | null} */ #socket = null;

  /** @param {{message: (message: any) => void, image: (bytes: ArrayBuffer) => void,
   *   opened: (open: boolean) => void}} receiver */
  constructor(receiver) {
    this.receiver = receiver;
  }

  open() {
    // The page's own query may hold the token that a page from another machine needs.
    const address = new URL(`/socket${location.search}`, location.href);
    address.protocol = location.protocol === "https:" ? "wss:" : "ws:";
    const socket = new WebSocket(address);
    socket.binaryType = "arraybuffer";
    this.#socket = socket;
    socket.addEventListener("open", () => {
      this.#wait = FIRST_WAIT;
      this.receiver.opened(true);
    });
    socket.addEventListener("message", ({ data }) => {
      if (typeof data === "string") this.receiver.message(JSON.parse(data));
      else this.receiver.image(data);
    });
    socket.addEventListener("close", () => {
      this.receiver.opened(false);
      setTimeout(() => this.open(), 1000 * this.#wait);
      this.#wait = Math.min(LONGEST_WAIT, 1.6 * this.#wait);
    });
  }

  /** Sends a message; without a connection it is dropped.
   * @param {{type: string} & Record<string, any>} message */
  send(message) {
    if (this.#socket?.readyState === WebSocket.OPEN) this.#socket.send(JSON.stringify(message));
  }
}
