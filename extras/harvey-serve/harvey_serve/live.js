// The live page: each message of /events holds all that is shown, so a message that is missed is not missed for long.
const plans = JSON.parse(document.getElementById("data").textContent).plans;
const token = location.hash.slice(1);
const source = new EventSource("/events");
const STOP_WAITS_MS = 2000;
const STOP_AGAIN_MS = 200;

function byId(id) {
  return document.getElementById(id);
}

/** A line on a plan, through those of its points that are on this storey. */
function showLine(svg, plan, kind, points) {
  let line = svg.querySelector(`.${kind}`);
  if (line === null) {
    line = drawn("polyline", { class: `path ${kind}` });
    svg.querySelector(".candidates").before(line);
  }
  const on = points.filter(([locale]) => plan.rooms.includes(locale));
  line.setAttribute("points", on.map(([, x, y]) => `${plan.scale * (x - plan.left)},${plan.scale * (plan.top - y)}`).join(" "));
}

function showPlans(belief, candidates, trail, way) {
  document.querySelectorAll("#plans svg").forEach((svg, number) => {
    const plan = plans[number];
    const here = belief !== null && plan.rooms.includes(belief.locale);
    svg.style.display = here || (belief === null && number === 0) ? "" : "none";
    svg.querySelector(".mark.true").style.display = "none"; // nobody tells the page the truth
    const mark = svg.querySelector(".mark.believed");
    mark.style.display = here ? "" : "none";
    if (here) placeBelief(plan, mark, belief);
    const marks = candidates.filter((one) => plan.rooms.includes(one.locale)).map((one) => candidateMark(plan, one));
    svg.querySelector(".candidates").replaceChildren(...marks);
    showLine(svg, plan, "trail", trail);
    showLine(svg, plan, "way", here ? [[belief.locale, belief.x, belief.y], ...way] : way);
  });
}

function showPicture(picture) {
  if (picture === null) return;
  const [width, height] = picture.size;
  const svg = byId("picture");
  svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
  svg.replaceChildren(drawn("image", { width, height, href: `data:image/jpeg;base64,${picture.jpeg}` }));
  for (const kind of ["found", "agreed"]) {
    for (const [x1, y1, x2, y2] of picture[kind] ?? []) svg.append(drawn("line", { x1, y1, x2, y2, class: kind }));
  }
  byId("picture-name").textContent = picture.ref;
}

function cells(...texts) {
  const row = element("tr");
  row.append(...texts.map((text) => element("td", {}, text)));
  return row;
}

function decisionRow(one) {
  const row = cells(String(one.cycle), one.level, one.who, one.trigger, one.refused);
  for (const made of one.made) {
    const because = made.because.length > 0 ? ` (because of ${made.because.join(", ")})` : "";
    row.lastElementChild.append(element("div", {}, made.says + because));
  }
  return row;
}

source.addEventListener("message", (event) => {
  const run = JSON.parse(event.data);
  byId("state").textContent = run.ended ? `ended, ${run.ended}` : run.state;
  byId("cycle").textContent = run.cycle;
  byId("time").textContent = run.time_s === null ? "0.0" : run.time_s.toFixed(1);
  showPlans(run.belief, run.candidates, run.trail, run.way);
  const lost = !run.ended && run.lost !== "";
  byId("where").textContent = run.ended ? "ENDED" : lost ? "LOST" : run.belief === null ? "No belief yet" : "Knows where it is";
  byId("where").className = lost ? "lost" : "";
  byId("goal-now").textContent = run.goal ? `; goal: ${run.goal}` : "";
  showPicture(run.picture);
  const why = lost ? `Lost: ${run.lost}. What it believed until then is not relied on. ` : "";
  byId("belief").textContent = run.belief === null ? "It has no belief yet." : `${why}${run.belief.ref}: ${run.belief.says}`;
  byId("candidates").replaceChildren(...run.candidates.map((one) =>
    element("li", {}, `may stand at ${one.place}, weight ${one.weight.toFixed(2)}; ${one.evidence}`)));
  byId("said").replaceChildren(...run.said.map((one) => element("li", {}, `It ${one}`)));
  document.querySelector("#milestones tbody").replaceChildren(...run.milestones.map((one) => {
    const row = cells(`${one.id}: ${one.what}`, one.status);
    row.lastElementChild.className = one.status.replace(" ", "-");
    return row;
  }).reverse());
  document.querySelector("#decisions tbody").replaceChildren(...run.decisions.map(decisionRow).reverse());
  if (run.ended) {
    source.close();
    byId("orders").hidden = true;
    byId("go").hidden = true;
  }
});
source.addEventListener("error", () => {
  if (source.readyState !== EventSource.CLOSED) byId("state").textContent = "the line is lost";
});

async function post(path, body, answer) {
  const asked = { method: "POST", headers: { Authorization: `Bearer ${token}` }, body };
  const said = await fetch(path, asked).then((got) => got.text(), () => "nobody answered");
  byId(answer).textContent = said.trim();
}

/** Stop is said again until somebody answers, or the run is over: a line that is lost, or a busy server, may eat it. */
async function stop() {
  for (let tries = 1; !byId("orders").hidden; tries += 1) {
    const asked = { method: "POST", headers: { Authorization: `Bearer ${token}` }, signal: AbortSignal.timeout(STOP_WAITS_MS) };
    const got = await fetch("/orders/stop", asked).catch(() => null);
    if (got !== null && got.status < 500) {
      byId("answer").textContent = (await got.text().catch(() => "it was heard")).trim();
      return;
    }
    byId("answer").textContent = `nobody answered; Stop is said again, ${tries} times so far`;
    await new Promise((done) => setTimeout(done, STOP_AGAIN_MS));
  }
}

showPlans(null, [], [], []);
byId("orders").hidden = token === "";
byId("go").hidden = token === "";
byId("only-watching").hidden = token !== "";
document.addEventListener("click", (event) => {
  const order = event.target.closest("button[data-order]")?.dataset.order;
  if (order === "stop") stop();
  else if (order !== undefined) post(`/orders/${order}`, null, "answer");
  const words = event.target.closest("button[data-say]")?.dataset.say;
  if (words !== undefined) post("/goal", words, "goal-answer");
});
byId("go").addEventListener("submit", (event) => {
  event.preventDefault();
  post("/goal", byId("goal").value, "goal-answer");
});
