// Start the motions of the page; the keyboard moves the one that was touched last.

const page = document.documentElement;
const fail = (error) => {
  page.dataset.error = String(error?.message || error);
  const note = make("p", { class: "failure", role: "alert" }, [`This page could not be drawn: ${page.dataset.error}`]);
  document.querySelector("main").prepend(note);
};
window.addEventListener("error", (event) => fail(event.error || event.message));

const players = [...document.querySelectorAll(".motion")].map((host) => {
  const data = JSON.parse(document.getElementById(host.dataset.source).textContent);
  return new Player(host, data);
});
let active = players[0];
for (const player of players)
  for (const touch of ["pointerdown", "focusin"]) player.host.addEventListener(touch, () => { active = player; });

document.addEventListener("keydown", (event) => {
  if (!active || event.ctrlKey || event.metaKey || event.altKey) return;
  const control = event.target.closest("input, select, summary, textarea, a, button");
  const frames = { ArrowLeft: -1, ArrowRight: 1, PageUp: -30, PageDown: 30 }[event.key] * (event.shiftKey ? 10 : 1);
  if (event.key === " " && !(control && control !== active.slider && control !== active.button)) active.play(!active.playing);
  else if (frames && event.key.startsWith("Arrow") && (!control || control === active.slider || control === active.button)) active.step(frames);
  else if (event.key === "Home" && (!control || control === active.slider)) active.seek(0);
  else if (event.key === "End" && (!control || control === active.slider)) active.seek(active.motion.duration);
  else return;
  event.preventDefault();
});

// report.html#t=12.5 opens at that time, report.html#play plays; links to moments do so without leaving the place.
function wished() {
  const wish = new URLSearchParams(location.hash.slice(1));
  if (active && wish.has("t")) active.seek(Number(wish.get("t")) - active.motion.start || 0);
  if (active && wish.has("play") && !matchMedia("(prefers-reduced-motion: reduce)").matches) active.play(true);
}
wished();
window.addEventListener("hashchange", wished);
document.addEventListener("click", (event) => {
  const link = event.target.closest('a[href^="#t="]');
  if (!link || !active) return;
  event.preventDefault();
  active.play(false);
  history.replaceState(null, "", link.hash);
  wished();
  const box = active.host.getBoundingClientRect();
  if (box.top > innerHeight * 0.6 || box.bottom < innerHeight * 0.4) active.host.scrollIntoView();
});
// A link to what is folded opens it.
const unfold = () => { const found = location.hash.length > 1 && document.getElementById(location.hash.slice(1)); if (found?.matches?.("details")) found.open = true; };
window.addEventListener("hashchange", unfold);
unfold();

window.maniport = { players, principalAxes, smoothed, poseAt, asCSV, asSVG }; // for those who open the console
page.dataset.ready = "true";
