// @ts-check
// The page is loaded again when one of its files did not come: half a page looks alive, but nobody hears its STOP.

const AGAIN_MS = 1000;

addEventListener("error", ({ target }) => {
  const isPart = target instanceof HTMLScriptElement || (target instanceof HTMLLinkElement && target.rel === "stylesheet");
  if (isPart) setTimeout(() => location.reload(), AGAIN_MS);
}, true);
