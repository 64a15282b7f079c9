// @ts-check
// Decodes one picture. An ImageDecoder takes the bytes as they are, where a browser has one; a Blob passes through another process.

/** @typedef {{image: ImageBitmap | VideoFrame, width: number, height: number}} DecodedPicture */

/**
 * Whoever takes the image closes it.
 * @param {Uint8Array} body @param {string} type
 * @param {"default" | "none"} [conversion] of colours; none: grey levels stay the numbers that they are
 * @returns {Promise<DecodedPicture>}
 */
export async function decodePicture(body, type, conversion = "default") {
  if (!("ImageDecoder" in globalThis)) {
    const blob = new Blob([/** @type {BlobPart} */ (body)], { type });
    const image = await createImageBitmap(blob, { colorSpaceConversion: conversion, premultiplyAlpha: conversion });
    return { image, width: image.width, height: image.height };
  }
  const decoder = new ImageDecoder({ data: /** @type {BufferSource} */ (body), type, colorSpaceConversion: conversion, premultiplyAlpha: conversion });
  try {
    const { image } = await decoder.decode();
    return { image, width: image.displayWidth, height: image.displayHeight };
  } finally {
    decoder.close();
  }
}
