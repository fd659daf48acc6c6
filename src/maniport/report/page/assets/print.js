// What is printed: pictures in space as they are seen now, what is folded, and all in the colours for light ground.

const restored = [];

function printed(on) {
  if (on) page.dataset.print = "true"; else delete page.dataset.print;
  colors.known.clear();
  player?.show();
}

function readyForPrint() {
  printed(true);
  for (const details of document.querySelectorAll("details.folded:not([open])")) {
    details.open = true;
    restored.push(() => { details.open = false; });
  }
  player?.show(); // what is drawn can be taken until the page is shown again
  for (const { stage } of player?.stages ?? []) {
    if (!stage.gl || stage.gl.isContextLost() || !stage.canvas.width) continue;
    const picture = make("img", { alt: stage.canvas.getAttribute("aria-label"), src: stage.canvas.toDataURL() });
    stage.canvas.before(picture); // a canvas of WebGL is empty once it was shown
    stage.canvas.hidden = true;
    restored.push(() => { picture.remove(); stage.canvas.hidden = false; });
  }
}

window.addEventListener("beforeprint", readyForPrint);
window.addEventListener("afterprint", () => {
  for (const undo of restored.splice(0)) undo();
  printed(false);
});
