// What is printed: pictures in space as they are seen now, and what is folded.

let restored = [];

function readyForPrint() {
  for (const details of document.querySelectorAll("details.folded:not([open]), details.mind:not([open])")) {
    details.open = true;
    restored.push(() => { details.open = false; });
  }
  for (const player of players) {
    player.show();
    for (const { stage } of player.stages) {
      if (!stage.gl || stage.gl.isContextLost() || !stage.canvas.width) continue;
      const picture = make("img", { alt: stage.canvas.getAttribute("aria-label"), src: stage.canvas.toDataURL() });
      stage.canvas.before(picture); // a canvas of WebGL is empty once it was shown
      stage.canvas.hidden = true;
      restored.push(() => { picture.remove(); stage.canvas.hidden = false; });
    }
  }
}

window.addEventListener("beforeprint", readyForPrint);
window.addEventListener("afterprint", () => { for (const undo of restored.splice(0)) undo(); });
