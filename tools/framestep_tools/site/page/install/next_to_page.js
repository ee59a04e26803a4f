// Files that lie next to the page: images, and the files of boards without one.

/** The file cannot be used; the message is for the user. */
export class FileError extends Error {}

/** Fetch a file. Throws FileError if it is not the one that the page was built with. */
export async function fetchFile({ file, size, sha256 }) {
  let content;
  try {
    const answer = await fetch(file);
    if (!answer.ok) throw new Error(`${answer.status}`);
    content = await answer.arrayBuffer();
  } catch (error) {
    throw new FileError(`${file} cannot be loaded (${error.message}); nothing has been written`);
  }
  if (content.byteLength !== size || (await digest(content)) !== sha256) throw new FileError(`${file} is damaged: it is not the file that this page was built with; nothing has been written`);
  return content;
}

/** Return the SHA-256 as hexadecimal digits. */
export async function digest(content) {
  const sum = new Uint8Array(await crypto.subtle.digest("SHA-256", content));
  return [...sum].map((byte) => byte.toString(16).padStart(2, "0")).join("");
}
