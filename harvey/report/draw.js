"use strict";
// What the pages draw with: elements, and marks on a plan.
const SVG = "http://www.w3.org/2000/svg";

function element(name, attributes = {}, text = "") {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  made.textContent = text;
  return made;
}

function drawn(name, attributes) {
  const made = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  return made;
}

function metres(length) {
  return length > 0.1 ? `${length.toFixed(2)} m` : `${(1000 * length).toFixed(1)} mm`;
}

/** Where a point of the world is on a plan, as a transformation. */
function there(plan, x, y, angle) {
  const degrees = (-angle * 180) / Math.PI;
  return `translate(${plan.scale * (x - plan.left)} ${plan.scale * (plan.top - y)}) rotate(${degrees})`;
}

function ellipse(plan, one) {
  const [long, short] = [one.sigma, one.sigma_short].map((sigma) => Math.max(1, 3 * sigma * plan.scale));
  return { rx: long, ry: short };
}

/** Puts the mark of a belief, with its ellipse, where it is on a plan. */
function placeBelief(plan, mark, belief) {
  mark.setAttribute("transform", there(plan, belief.x, belief.y, belief.heading));
  const round = mark.querySelector("ellipse");
  round.setAttribute("transform", `rotate(${((belief.heading - belief.along) * 180) / Math.PI})`);
  for (const [key, value] of Object.entries(ellipse(plan, belief))) round.setAttribute(key, value);
}

function candidateMark(plan, one) {
  const mark = drawn("g", { transform: there(plan, one.x, one.y, one.heading), opacity: 0.3 + 0.7 * one.weight });
  mark.append(drawn("ellipse", { ...ellipse(plan, one), rx: 14, ry: 14 }), drawn("path", { d: "M 22 0 L -8 8 L -8 -8 Z" }));
  return mark;
}
