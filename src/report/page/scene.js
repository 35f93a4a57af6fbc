// The viewer: shape, cameras with their pictures, the input's points.

const CAMERA = 0x5d6878;
const CHOSEN_CAMERA = 0xd1495b;
/** Of a camera's frustum, diagonals of the object. */
const FRUSTUM_DEPTH = 0.16;
const FIELD_OF_VIEW_DEG = 35;
/** Where the viewer starts: so far round from the cameras, radians, and so near, diagonals, that the object fills the view. */
const BESIDE = 0.6;
const DISTANCE = 1.8;

/** Opens the viewer, or says why it cannot; calls `picked` with the index of a camera that is clicked. */
async function openScene(data, pictures, picked) {
  try {
    const scene = new SceneView(data, pictures, picked);
    await scene.load();
    return scene;
  } catch (error) {
    const trouble = document.getElementById("scene-trouble");
    trouble.textContent = `The viewer needs WebGL, which this browser does not offer (${error.message}). Open mesh.glb or shape.ply in another viewer.`;
    trouble.hidden = false;
    document.getElementById("scene").hidden = true;
    return null;
  }
}

/** The world matrix of a camera of the viewer's kind (y up, looks along -z) for `camera_from_object` of ours. */
function objectFromCamera({ rotation: r, translation: t }) {
  const cameraFromObject = new viewer.Matrix4().set(
    ...[...r[0], t[0]],
    ...[...r[1], t[1]],
    ...[...r[2], t[2]],
    ...[0, 0, 0, 1],
  );
  const flip = new viewer.Matrix4().makeScale(1, -1, -1);
  return cameraFromObject.invert().multiply(flip);
}

/** The edges of the picture at depth 1: left, right, top, bottom. */
function edges({ camera: { fx, fy, cx, cy }, size: [width, height] }) {
  return [-cx / fx, (width - cx) / fx, cy / fy, (cy - height) / fy];
}

class SceneView {
  constructor(data, pictures, picked) {
    this.data = data;
    this.canvas = document.getElementById("scene");
    // What was drawn is kept, so that the canvas can be saved as a picture.
    this.renderer = new viewer.WebGLRenderer({
      canvas: this.canvas,
      antialias: true,
      alpha: true,
      preserveDrawingBuffer: true,
    });
    this.scene = new viewer.Scene();
    this.camera = new viewer.PerspectiveCamera(FIELD_OF_VIEW_DEG, 1, 0.01, 200);
    this.through = new viewer.PerspectiveCamera();
    this.through.matrixAutoUpdate = false;
    this.isThrough = false;
    this.scene.add(new viewer.HemisphereLight(0xffffff, 0x8a929e, 2.2));
    const light = new viewer.DirectionalLight(0xffffff, 1.4);
    light.position.set(1, 2, -1.5);
    this.scene.add(light);
    this.controls = new viewer.OrbitControls(this.camera, this.canvas);
    this.controls.addEventListener("change", () => this.draw());
    this.controls.addEventListener("start", () => this.setThrough(false));
    this.cameras = this.makeCameras(pictures);
    this.scene.add(this.cameras);
    this.makePicking(picked);
    new ResizeObserver(() => this.resize()).observe(this.canvas.parentElement);
  }

  async load() {
    const { shape, input_points: inputPoints } = this.data;
    this.shape = shape.kind === "mesh" ? await MeshShape.load(shape) : new PointShape(shape);
    this.scene.add(this.shape.group);
    Object.assign(this.canvas.dataset, this.shape.facts());
    makeChoice(document.getElementById("colouring"), this.shape.colourings(), (key) => {
      this.shape.colour(key);
      this.draw();
    });
    this.addSwitch("cameras", true, (on) => (this.cameras.visible = on));
    this.addSwitch("pictures", true, (on) => {
      for (const frustum of this.cameras.children) frustum.userData.plane.visible = on;
    });
    const [label, act] = this.shape.detail();
    this.addSwitch(label, false, act);
    if (inputPoints) {
      const points = makeInputPoints(inputPoints);
      this.scene.add(points);
      this.addSwitch(`input's points (${inputPoints.count.toLocaleString("en")})`, false, (on) => (points.visible = on));
    }
    document.getElementById("shape-opacity").addEventListener("input", ({ target }) => {
      this.shape.setOpacity(Number(target.value));
      this.draw();
    });
    document.getElementById("through").addEventListener("click", () => this.setThrough(!this.isThrough));
    document.getElementById("reset").addEventListener("click", () => this.reset());
    this.resize();
    this.reset();
  }

  addSwitch(label, on, act) {
    const element = document.createElement("label");
    element.className = "switch";
    const box = Object.assign(document.createElement("input"), { type: "checkbox", checked: on });
    box.addEventListener("change", () => {
      act(box.checked);
      this.draw();
    });
    element.append(box, ` ${label}`);
    document.getElementById("switches").append(element);
    act(on);
  }

  makeCameras(pictures) {
    const group = new viewer.Group();
    this.data.frames.forEach((frame, index) => {
      const frustum = makeFrustum(frame, pictures[index].image);
      frustum.userData.index = index;
      group.add(frustum);
    });
    return group;
  }

  /** A click that does not drag picks the camera under it. */
  makePicking(picked) {
    const ray = new viewer.Raycaster();
    let pressed = null;
    this.canvas.addEventListener("pointerdown", ({ clientX, clientY }) => (pressed = [clientX, clientY]));
    this.canvas.addEventListener("pointerup", ({ clientX, clientY }) => {
      if (!pressed || Math.hypot(clientX - pressed[0], clientY - pressed[1]) > 4 || !this.cameras.visible) return;
      const box = this.canvas.getBoundingClientRect();
      const at = new viewer.Vector2(
        (2 * (clientX - box.left)) / box.width - 1,
        1 - (2 * (clientY - box.top)) / box.height,
      );
      ray.setFromCamera(at, this.camera);
      const planes = this.cameras.children.map((frustum) => frustum.userData.plane);
      const [hit] = ray.intersectObjects(planes, false);
      if (hit) picked(hit.object.parent.userData.index);
    });
  }

  /** Makes a frame's camera stand out, and looks through it where that is wanted. */
  show(index) {
    this.index = index;
    for (const frustum of this.cameras.children) {
      const chosen = frustum.userData.index === index;
      frustum.userData.lines.material.color.set(chosen ? CHOSEN_CAMERA : CAMERA);
    }
    this.draw();
  }

  setThrough(on) {
    if (this.isThrough && !on) {
      // Goes on from there, upright.
      this.camera.position.setFromMatrixPosition(this.through.matrix);
      this.controls.target.set(0, 0, 0);
      this.controls.update();
    }
    this.isThrough = on;
    document.getElementById("through").setAttribute("aria-pressed", String(on));
    this.draw();
  }

  reset() {
    this.isThrough = false;
    document.getElementById("through").setAttribute("aria-pressed", "false");
    this.camera.position.copy(this.startingPoint());
    this.controls.target.set(0, 0, 0);
    this.controls.update();
    this.draw();
  }

  /** Beside the cameras and a little higher, on the side from which more than one face of the object is seen. */
  startingPoint() {
    const centres = this.data.frames.map((frame) => new viewer.Vector3().setFromMatrixPosition(objectFromCamera(frame)));
    const from = centres.reduce((sum, centre) => sum.add(centre.normalize()), new viewer.Vector3()).setY(0);
    if (from.length() < 0.1) from.set(0, 0, -1);
    from.normalize();
    const up = new viewer.Vector3(0, 1, 0);
    const sides = [BESIDE, -BESIDE].map((turn) => from.clone().applyAxisAngle(up, turn));
    const [better] = sides.sort((a, b) => Math.abs(b.x * b.z) - Math.abs(a.x * a.z));
    return better.setY(0.45).setLength(DISTANCE / Math.min(1, this.camera.aspect));
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.canvas.parentElement;
    if (width === 0 || height === 0) return;
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2));
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.draw();
  }

  /** As soon as the browser next shows something. */
  draw() {
    if (this.pending) return;
    this.pending = requestAnimationFrame(() => {
      this.pending = 0;
      for (const frustum of this.cameras.children) this.place(frustum);
      if (this.isThrough) this.placeThrough();
      this.renderer.render(this.scene, this.isThrough ? this.through : this.camera);
    });
  }

  /** The plane of the camera that is looked through lies behind the object, the others at their frustum's end. */
  place({ userData: { index, plane, lines, distance } }) {
    const behind = this.isThrough && index === this.index;
    plane.scale.setScalar(behind ? (distance + 0.9) / FRUSTUM_DEPTH : 1);
    lines.visible = !behind;
    plane.parent.visible = behind || !this.isThrough;
  }

  /** The frame's own perspective, with as much around it as the canvas is wider or higher. */
  placeThrough() {
    const frame = this.data.frames[this.index];
    this.through.matrix.copy(objectFromCamera(frame));
    this.through.matrixWorldNeedsUpdate = true;
    const [left, right, top, bottom] = edges(frame);
    const { clientWidth, clientHeight } = this.canvas.parentElement;
    const ratio = clientWidth / clientHeight / ((right - left) / (top - bottom));
    const wider = ((right - left) * (Math.max(ratio, 1) - 1)) / 2;
    const higher = ((top - bottom) * (Math.max(1 / ratio, 1) - 1)) / 2;
    const near = 0.01;
    this.through.projectionMatrix.makePerspective(
      near * (left - wider),
      near * (right + wider),
      near * (top + higher),
      near * (bottom - higher),
      near,
      1000,
      this.through.coordinateSystem,
    );
    this.through.projectionMatrixInverse.copy(this.through.projectionMatrix).invert();
  }
}

/** Edges from the centre to the picture's corners, and the picture at their end. */
function makeFrustum(frame, image) {
  const [left, right, top, bottom] = edges(frame).map((edge) => edge * FRUSTUM_DEPTH);
  const depth = -FRUSTUM_DEPTH;
  const corners = [
    [left, top, depth],
    [right, top, depth],
    [right, bottom, depth],
    [left, bottom, depth],
  ];
  const segments = corners.flatMap((corner, k) => [0, 0, 0, ...corner, ...corner, ...corners[(k + 1) % 4]]);
  const lines = new viewer.LineSegments(
    new viewer.BufferGeometry().setAttribute("position", new viewer.BufferAttribute(new Float32Array(segments), 3)),
    new viewer.LineBasicMaterial({ color: CAMERA }),
  );
  const geometry = new viewer.BufferGeometry();
  geometry.setAttribute("position", new viewer.BufferAttribute(new Float32Array(corners.flat()), 3));
  geometry.setAttribute("uv", new viewer.BufferAttribute(new Float32Array([0, 1, 1, 1, 1, 0, 0, 0]), 2));
  geometry.setIndex([0, 2, 1, 0, 3, 2]);
  const texture = new viewer.Texture(image);
  texture.colorSpace = viewer.SRGBColorSpace;
  texture.needsUpdate = true;
  const material = new viewer.MeshBasicMaterial({ map: texture, side: viewer.DoubleSide });
  const plane = new viewer.Mesh(geometry, material);
  const frustum = new viewer.Group();
  frustum.add(lines, plane);
  frustum.applyMatrix4(objectFromCamera(frame));
  frustum.userData = { plane, lines, distance: Math.hypot(...frame.translation) };
  return frustum;
}

function makeInputPoints({ positions, colours }) {
  const geometry = new viewer.BufferGeometry();
  geometry.setAttribute("position", new viewer.BufferAttribute(unpacked(positions, Float32Array), 3));
  geometry.setAttribute("color", colourAttribute(unpacked(colours, Uint8Array)));
  return new viewer.Points(geometry, new viewer.PointsMaterial({ size: 0.006, vertexColors: true }));
}
