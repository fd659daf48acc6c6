// Start the motion of the page, which the keyboard moves.

const page = document.documentElement;
const fail = (error) => {
  page.dataset.error = String(error?.message || error);
  const note = make("p", { class: "failure", role: "alert" }, [`This page could not be drawn: ${page.dataset.error}`]);
  document.querySelector("main").prepend(note);
};
window.addEventListener("error", (event) => fail(event.error || event.message));

const host = document.querySelector(".motion");
const player = host && new Player(host, JSON.parse(document.getElementById("motion").textContent));

document.addEventListener("keydown", (event) => {
  if (!player || event.ctrlKey || event.metaKey || event.altKey) return;
  const control = event.target.closest("input, select, summary, textarea, a, button");
  const frames = { ArrowLeft: -1, ArrowRight: 1, PageUp: -30, PageDown: 30 }[event.key] * (event.shiftKey ? 10 : 1);
  if (event.key === " " && !(control && control !== player.slider && control !== player.button)) player.play(!player.playing);
  else if (frames && event.key.startsWith("Arrow") && (!control || control === player.slider || control === player.button)) player.step(frames);
  else if (event.key === "Home" && (!control || control === player.slider)) player.seek(0);
  else if (event.key === "End" && (!control || control === player.slider)) player.seek(player.motion.duration);
  else return;
  event.preventDefault();
});

// report.html#t=12.5 opens at that time, report.html#play plays; links to moments do so without leaving the place.
function wished() {
  const wish = new URLSearchParams(location.hash.slice(1));
  if (player && wish.has("t")) player.open(Number(wish.get("t")) - player.motion.start || 0);
  if (player && wish.has("play") && !matchMedia("(prefers-reduced-motion: reduce)").matches) player.play(true);
}
wished();
window.addEventListener("hashchange", wished);
document.addEventListener("click", (event) => {
  const link = event.target.closest('a[href^="#t="]');
  if (!link || !player) return;
  event.preventDefault();
  player.play(false);
  history.replaceState(null, "", link.hash);
  wished();
  const box = player.host.getBoundingClientRect();
  if (box.top > innerHeight * 0.6 || box.bottom < innerHeight * 0.4) player.host.scrollIntoView();
});
// A link to what is folded opens it.
const unfold = () => { const found = location.hash.length > 1 && document.getElementById(location.hash.slice(1)); if (found?.matches?.("details")) found.open = true; };
window.addEventListener("hashchange", unfold);
unfold();

window.maniport = { player }; // for those who open the console
page.dataset.ready = "true";
