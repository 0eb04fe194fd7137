// The page of a run: everything that it shows stands in the element "data"; nothing is fetched.
let run;
const NEAR = 12; // so many decisions are listed before and after the one that is shown
const scrubber = document.getElementById("cycle");

/** What stands in the element "data": JSON as gzip in base 64. */
async function unpack() {
  const packed = await fetch(`data:application/gzip;base64,${document.getElementById("data").textContent}`);
  return new Response(packed.body.pipeThrough(new DecompressionStream("gzip"))).json();
}

/** The last of some items whose cycle, which grows, is not after this; undefined where there is none. */
function last(items, cycle, at = (item) => item.cycle) {
  let low = 0;
  let high = items.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (at(items[middle]) <= cycle) low = middle + 1;
    else high = middle;
  }
  return items[low - 1];
}

function reference(ref) {
  return element("button", { type: "button", "data-entry": ref }, ref);
}

function showPlan(cycle) {
  const belief = last(run.beliefs, cycle);
  const truth = last(run.track, cycle, (row) => row[0]);
  const lost = run.candidates.filter((one) => one.cycle <= cycle && (one.until === null || cycle < one.until));
  document.querySelectorAll("#plans svg").forEach((svg, number) => {
    const plan = run.plans[number];
    const here = belief !== undefined && plan.rooms.includes(belief.locale);
    const [green, blue] = [svg.querySelector(".mark.true"), svg.querySelector(".mark.believed")];
    green.toggleAttribute("hidden", !here || truth === undefined);
    blue.toggleAttribute("hidden", !here);
    green.style.display = here && truth !== undefined ? "" : "none";
    blue.style.display = here ? "" : "none";
    if (here && truth !== undefined) green.setAttribute("transform", there(plan, truth[1], truth[2], truth[3]));
    if (here) {
      placeBelief(plan, blue, belief);
    }
    const marks = lost.filter((one) => plan.rooms.includes(one.locale)).map((one) => candidateMark(plan, one));
    svg.querySelector(".candidates").replaceChildren(...marks);
  });
  showBelief(cycle, belief);
  document.getElementById("candidates").replaceChildren(...lost.map((one) => {
    const item = element("li", {}, `may stand at ${one.place}, weight ${one.weight.toFixed(2)}; ${one.evidence} `);
    item.append(reference(one.ref));
    return item;
  }));
}

function showBelief(cycle, belief) {
  const shown = document.getElementById("belief");
  if (belief === undefined) {
    shown.textContent = "It has no belief yet.";
    return;
  }
  const degrees = ((belief.sigma_heading * 180) / Math.PI).toFixed(1);
  shown.textContent = `It believes to be in ${belief.locale}, sure to ${metres(belief.sigma)} and ${degrees} degrees `;
  shown.append(reference(belief.ref));
  const truth = last(run.track, cycle, (row) => row[0]);
  if (truth !== undefined) {
    const off = Math.hypot(truth[1] - belief.x, truth[2] - belief.y);
    shown.append(`; in truth, as only the simulator knows, it is ${metres(off)} off.`);
  }
}

function showPicture(cycle) {
  const svg = document.getElementById("picture");
  const picture = last(run.pictures, cycle);
  svg.replaceChildren();
  const name = document.getElementById("picture-name");
  name.replaceChildren();
  if (picture === undefined) {
    name.textContent = "No picture yet";
    return;
  }
  const [width, height] = picture.size;
  svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
  svg.append(drawn("image", { width, height, href: `data:image/webp;base64,${picture.webp}` }));
  for (const kind of ["found", "expected", "agreed"]) {
    for (const [x1, y1, x2, y2] of picture[kind] ?? []) svg.append(drawn("line", { x1, y1, x2, y2, class: kind }));
  }
  name.append(reference(picture.ref), ` of cycle ${picture.cycle}${picture.milestone ? `, ${picture.milestone}` : ""}`);
}

function showDecisions(cycle) {
  const rows = run.cycles.slice(Math.max(0, cycle - 1 - NEAR), cycle + NEAR).map((one) => {
    const row = element("tr", one.cycle === cycle ? { "aria-current": "true" } : {});
    const first = element("td");
    first.append(element("button", { type: "button", "data-cycle": one.cycle }, String(one.cycle)));
    const woken = element("td");
    if (one.trigger) woken.append(reference(one.trigger));
    const made = element("td", {}, one.refused);
    for (const ref of [...one.observed, ...one.made]) {
      made.append(reference(ref), ` ${run.entries[ref]?.says ?? ""}`, element("br"));
    }
    const time = one.time_s === null ? "" : one.time_s.toFixed(1);
    row.append(first, element("td", {}, time), element("td", {}, one.level), element("td", {}, one.who), woken, made);
    return row;
  });
  document.querySelector("#decisions tbody").replaceChildren(...rows);
  const list = document.querySelector("#decisions").parentElement;
  const current = list.querySelector('[aria-current="true"]');
  list.scrollTop += current.getBoundingClientRect().top - list.getBoundingClientRect().top - list.clientHeight / 3;
}

/** An entry that opens on what it rests on. */
function reasons(ref, open) {
  const entry = run.entries[ref];
  const made = element("details", open ? { open: "" } : {});
  const says = entry === undefined ? "not in the journal" : `${entry.says} (by ${entry.by})`;
  const summary = element("summary", {}, `${ref}: ${says} `);
  made.append(summary);
  if (entry === undefined) return made;
  summary.append(element("button", { type: "button", "data-cycle": entry.cycle }, `cycle ${entry.cycle}`));
  const fill = () => {
    if (made.open && made.childElementCount === 1) {
      made.append(...entry.because.map((below) => reasons(below, false)));
      if (entry.because.length === 0) made.append(element("p", {}, "It comes from outside, or rests on nothing else."));
    }
  };
  made.addEventListener("toggle", fill);
  fill();
  return made;
}

let wanted = 0;
function show(cycle) {
  if (run === undefined) return; // is being unpacked
  const now = Math.min(Math.max(1, cycle), run.cycles.length);
  scrubber.value = now;
  document.getElementById("cycle-shown").value = now;
  clearTimeout(wanted); // of many moves of the slider at once only the last is drawn
  wanted = setTimeout(() => {
    showPlan(now);
    showPicture(now);
    showDecisions(now);
  }, 0);
}

scrubber.addEventListener("input", () => show(Number(scrubber.value)));
document.querySelector("form.scrubber").addEventListener("submit", (event) => event.preventDefault());
document.addEventListener("click", (event) => {
  const button = event.target.closest("button");
  if (button?.dataset.cycle) show(Number(button.dataset.cycle));
  if (button?.dataset.entry) {
    const why = document.getElementById("why");
    why.replaceChildren(reasons(button.dataset.entry, true));
    why.scrollIntoView({ block: "nearest" });
  }
});
unpack().then((data) => {
  run = data;
  document.getElementById("turns").append(...run.turns.flatMap((turn) => [
    element("button", { type: "button", "data-cycle": turn.cycle, title: turn.text }, `${turn.cycle} ${turn.kind}`), " "]));
  const first = run.turns.find((turn) => turn.kind === "lost") ?? run.turns[0];
  show(first === undefined ? run.cycles.length : first.cycle);
});
