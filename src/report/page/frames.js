// The frame that is looked at: its picture with what was found over it.

const OUTLINE = [64, 255, 220];
const OVERLAY_OPACITY = 0.62;

/** A `data:` address as a decoded picture. */
async function decoded(address) {
  const image = new Image();
  image.src = address;
  await image.decode();
  return image;
}

/** The pixels of a picture, RGBA. */
function pixelsOf(image) {
  const canvas = new OffscreenCanvas(image.naturalWidth, image.naturalHeight);
  const context = canvas.getContext("2d", { willReadFrequently: true });
  context.drawImage(image, 0, 0);
  return context.getImageData(0, 0, canvas.width, canvas.height);
}

/** A group of buttons of which one is down; calls `chosen` with its key. */
function makeChoice(element, options, chosen) {
  const buttons = options.map(([key, label, title]) => {
    const button = document.createElement("button");
    button.textContent = label;
    button.title = title;
    button.dataset.key = key;
    button.setAttribute("role", "radio");
    button.addEventListener("click", () => choose(key));
    return button;
  });
  element.append(...buttons);
  function choose(key) {
    for (const button of buttons) button.setAttribute("aria-checked", String(button.dataset.key === key));
    chosen(key);
  }
  choose(options[0][0]);
}

/** Draws frames into the panel; one at a time. */
class FramePanel {
  constructor(data) {
    this.frames = data.frames;
    this.scale = data.colour_scale;
    this.canvas = document.getElementById("picture");
    this.context = this.canvas.getContext("2d", { willReadFrequently: true });
    this.outline = document.getElementById("outline");
    this.outline.addEventListener("change", () => this.draw());
    this.index = 0;
    this.pictures = [];
    const layers = [
      ["overlay", "Overlay", "The shape over the picture, brighter is closer"],
      ["picture", "Picture", "The frame as it is"],
      ["depth", "Depth", "Depth of the shape"],
    ];
    if (this.frames.some((frame) => frame.has_input_depth)) {
      layers.push(["input", "Input depth", "Depth that the input came with, same colours"]);
    }
    makeChoice(document.getElementById("layer"), layers, (layer) => {
      this.layer = layer;
      this.draw();
    });
    const scale = document.getElementById("scale");
    const pixels = this.scale.flatMap((_, step) => [...this.scale[this.scale.length - 1 - step], 255]);
    scale.getContext("2d").putImageData(new ImageData(new Uint8ClampedArray(pixels), this.scale.length, 1), 0, 0);
  }

  /** Decodes every frame once. */
  async load() {
    const load = async ({ picture, layers }) => {
      const image = await decoded(picture);
      return { image, layers: pixelsOf(await decoded(layers)) };
    };
    this.pictures = await Promise.all(this.frames.map(load));
  }

  show(index) {
    this.index = index;
    const frame = this.frames[index];
    document.getElementById("frame-name").textContent = frame.name;
    const [far, near] = frame.depth_range;
    document.getElementById("scale-near").textContent = near.toFixed(2);
    document.getElementById("scale-far").textContent = `${far.toFixed(2)} diagonals`;
    const facts = [
      ["silhouette IoU", frame.silhouette_iou.toFixed(3)],
      ["density", frame.density.toFixed(3)],
      ["pose known to", frame.deviation
        ? `${angle(frame.deviation.rotation_deg)}, ${(100 * frame.deviation.location).toFixed(1)} % of a diagonal`
        : "–"],
      ["turn since the frame before", angle(frame.turn_deg)],
      ["turn against the input's pose", angle(frame.input_turn_deg)],
      ["distance", `${Math.hypot(...frame.translation).toFixed(2)} diagonals`],
      ["mask", frame.mask_anew ? "decided anew" : "as given"],
    ];
    const list = document.getElementById("frame-facts");
    list.replaceChildren(
      ...facts.map(([what, value]) => {
        const [pair, name, number] = ["div", "dt", "dd"].map((tag) => document.createElement(tag));
        name.textContent = what;
        number.textContent = value;
        pair.append(name, number);
        return pair;
      }),
    );
    this.draw();
  }

  draw() {
    const picture = this.pictures[this.index];
    if (!picture) return;
    const { width, height } = picture.layers;
    Object.assign(this.canvas, { width, height });
    this.context.drawImage(picture.image, 0, 0);
    const shown = this.context.getImageData(0, 0, width, height);
    this.paint(shown.data, picture.layers.data);
    if (this.outline.checked) paintOutline(shown.data, picture.layers.data, width, height);
    this.context.putImageData(shown, 0, 0);
    document.getElementById("depth-scale").style.visibility = this.layer === "picture" ? "hidden" : "visible";
    this.canvas.dataset.frame = this.index;
    this.canvas.dataset.layer = this.layer;
  }

  /** Red and green of the layers are the depths found and given. */
  paint(shown, layers) {
    if (this.layer === "picture") return;
    const channel = this.layer === "input" ? 1 : 0;
    const alone = this.layer !== "overlay";
    for (let at = 0; at < shown.length; at += 4) {
      const level = layers[at + channel];
      const opacity = level === 0 ? 0 : alone ? 1 : OVERLAY_OPACITY;
      const colour = this.scale[Math.round(((level - 1) / 254) * (this.scale.length - 1))];
      for (let part = 0; part < 3; part += 1) {
        const under = alone ? 236 : shown[at + part];
        shown[at + part] = opacity === 0 ? under : under + opacity * (colour[part] - under);
      }
    }
  }
}

/** The mask's pixels that touch what is outside of it. */
function paintOutline(shown, layers, width, height) {
  const inside = (column, row) =>
    column >= 0 && row >= 0 && column < width && row < height && layers[4 * (row * width + column) + 2] > 127;
  const outside = (column, row) =>
    column >= 0 && row >= 0 && column < width && row < height && !inside(column, row);
  for (let row = 0; row < height; row += 1) {
    for (let column = 0; column < width; column += 1) {
      if (!inside(column, row)) continue;
      const neighbours = [
        [column - 1, row],
        [column + 1, row],
        [column, row - 1],
        [column, row + 1],
      ];
      if (neighbours.some(([c, r]) => outside(c, r))) shown.set(OUTLINE, 4 * (row * width + column));
    }
  }
}

function angle(degrees) {
  return degrees === null ? "–" : `${degrees.toFixed(2)}°`;
}
