// @ts-check
// Who holds the wheel, by what the operator's process says.

import { hand } from "./requests.js";
import { WHEEL_TEXTS, operatorText } from "./text.js";

/**
 * @param {any} operator its newest word; undefined: none is heard
 * @returns {{isHolder: boolean, isFree: boolean, name: string}} whether it is this page, or nobody; who it is
 */
export function describeWheel(operator) {
  const isPage = operator?.wheel_by === "dashboard", isHolder = isPage && operator.wheel_hand === hand, isFree = operator?.wheel_by === "";
  const name = !operator ? WHEEL_TEXTS.unknown : isFree ? WHEEL_TEXTS.nobody : isHolder ? WHEEL_TEXTS.thisPage : isPage ? WHEEL_TEXTS.otherPage : operatorText(operator.wheel_by);
  return { isHolder, isFree, name };
}
