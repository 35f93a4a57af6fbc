// Joins viewer, frames and charts: one frame is looked at in all of them.

async function start() {
  const data = JSON.parse(document.getElementById("data").textContent);
  const slider = document.getElementById("frame");
  slider.max = data.frames.length - 1;
  const panel = new FramePanel(data);
  await panel.load();
  const scene = await openScene(data, panel.pictures, choose);

  function choose(index) {
    const chosen = Math.min(Math.max(index, 0), data.frames.length - 1);
    slider.value = chosen;
    panel.show(chosen);
    scene?.show(chosen);
    drawFrameCharts(data.frames, chosen);
  }
  slider.addEventListener("input", () => choose(Number(slider.value)));
  document.getElementById("before").addEventListener("click", () => choose(Number(slider.value) - 1));
  document.getElementById("after").addEventListener("click", () => choose(Number(slider.value) + 1));
  choose(Math.floor(data.frames.length / 2));
  drawCharts(data, Number(slider.value));

  let pending = 0;
  window.addEventListener("resize", () => {
    clearTimeout(pending);
    pending = setTimeout(() => drawCharts(data, Number(slider.value)), 150);
  });
  document.documentElement.dataset.ready = "true";
}

start();
