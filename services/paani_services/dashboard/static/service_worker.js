// @ts-check
/// <reference lib="webworker" />
// Keeps the page's own files, so that an installed page opens, and says that it has no link, while the network is down.
// The network comes first: what is kept is used only where the server does not answer. Nothing else is ever kept: no
// state, no picture, no request of an operator. What the operator asks for never waits for this worker: browsers that
// cannot send it past a worker (static routing) do not get one.

const worker = /** @type {ServiceWorkerGlobalScope} */ (/** @type {unknown} */ (self));
const KEPT = "paani-page";

/** @param {Request} request */
const isOwnFile = (request) => {
  const { origin, pathname } = new URL(request.url);
  return request.method === "GET" && origin === worker.location.origin && (pathname === "/" || pathname.startsWith("/static/"));
};

/** A redirect to the login, an error or a part is not kept. @param {Request | string} request @param {Response} response */
async function keep(request, response) {
  if (response.status === 200 && !response.redirected) await (await caches.open(KEPT)).put(request, response);
}

async function keepAll() {
  /** @type {string[]} */
  const names = await (await fetch("/static/files.json")).json();
  await Promise.all(["/", ...names.map((name) => `/static/${name}`)].map(async (path) => keep(path, await fetch(path))));
}

/** @param {Request} request */
async function answer(request) {
  try {
    const response = await fetch(request);
    void keep(request, response.clone());
    return response;
  } catch (error) {
    const kept = await (await caches.open(KEPT)).match(request, { ignoreVary: true });
    if (kept) return kept;
    throw error;
  }
}

/** @param {any} event */
async function install(event) {
  await event.addRoutes([
    { condition: { requestMethod: "POST" }, source: "network" },
    { condition: { urlPattern: { pathname: "/api/*" } }, source: "network" },
  ]);
  await keepAll();
  await worker.skipWaiting();
}

worker.addEventListener("install", (event) => event.waitUntil(install(event)));
worker.addEventListener("activate", (event) => event.waitUntil(worker.clients.claim()));
worker.addEventListener("fetch", (event) => {
  if (isOwnFile(event.request)) event.respondWith(answer(event.request));
});
