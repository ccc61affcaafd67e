/**
 * @typedef {import("../types.js").ImageHeader} ImageHeader
 */

/** Splits a binary message into its header and the image's bytes.
 * @param {ArrayBuffer} message @returns {{header: ImageHeader, bytes: Uint8Array}}
 * @throws {RangeError} the message is shorter than it says */
export function parsedImage(message) {
  const length = new DataView(message).getUint32(0, true);
  if (4 + length > message.byteLength) {
    throw new RangeError(`image message: header of ${length} bytes in ${message.byteLength}`);
  }
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(message, 4, length)));
  return { header, bytes: new Uint8Array(message, 4 + length) };
}

/** The media type of an image by its first bytes. @param {Uint8Array} bytes */
export const mediaType = (bytes) => (bytes[0] === 0x89 ? "image/png" : "image/jpeg");

/** Which images of a pane to show: of a look at least as new as the one shown, in the order they came. */
export class Freshness {
  look = -1;
  arrival = -1;

  /** @param {number} look @param {number} arrival grows with each image of the pane
   * @returns {boolean} whether to show it; then nothing older will do */
  accepts(look, arrival) {
    if (look < this.look || arrival < this.arrival) return false;
    this.look = look;
    this.arrival = arrival;
    return true;
  }
}
