// The shape in the viewer: a textured mesh, or points.

const CLAY = 0xc9ced6;

/** Bytes of base64 as an array of another kind. */
function unpacked(text, Kind) {
  const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  return new Kind(bytes.buffer);
}

/** sRGB of files as the linear colours that the renderer reckons with. */
function colourAttribute(bytes) {
  const linear = Float32Array.from(bytes, (part) => {
    const share = part / 255;
    return share <= 0.04045 ? share / 12.92 : ((share + 0.055) / 1.055) ** 2.4;
  });
  return new viewer.BufferAttribute(linear, 3);
}

/** A textured mesh. */
class MeshShape {
  static async load({ glb, origin }) {
    const gltf = await new viewer.GLTFLoader().parseAsync(unpacked(glb, Uint8Array).buffer, "");
    const shape = new MeshShape();
    shape.group = gltf.scene;
    gltf.scene.traverse((node) => {
      if (node.isMesh) shape.mesh = node;
    });
    // The file may scale it to metres; cameras are in object units.
    shape.mesh.scale.setScalar(1);
    shape.texture = shape.mesh.material.map;
    if (origin) {
      shape.origin = await new viewer.TextureLoader().loadAsync(origin);
      shape.origin.flipY = false;
      shape.origin.colorSpace = viewer.SRGBColorSpace;
    }
    shape.wires = new viewer.LineSegments(
      new viewer.WireframeGeometry(shape.mesh.geometry),
      new viewer.LineBasicMaterial({ color: 0x1f2733, transparent: true, opacity: 0.25 }),
    );
    shape.mesh.add(shape.wires);
    return shape;
  }

  facts() {
    const { image } = this.texture;
    return {
      shape: "mesh",
      triangles: this.mesh.geometry.index.count / 3,
      texture: `${image.width}x${image.height}`,
    };
  }

  colourings() {
    const colourings = [
      ["texture", "Texture", "Colours of the frames"],
      ["plain", "Plain", "No colour, lit"],
      ["normals", "Normals", "Coloured by direction"],
    ];
    if (this.origin) {
      const title = "Green: seen in a frame; yellow: its mirror image is seen; red: filled from around";
      colourings.push(["origin", "Source", title]);
    }
    return colourings;
  }

  colour(key) {
    this.mesh.material = {
      texture: () => new viewer.MeshBasicMaterial({ map: this.texture }),
      plain: () => new viewer.MeshLambertMaterial({ color: CLAY }),
      normals: () => new viewer.MeshNormalMaterial(),
      origin: () => new viewer.MeshBasicMaterial({ map: this.origin }),
    }[key]();
    this.setOpacity(this.opacity ?? 1);
  }

  detail() {
    return ["wireframe", (on) => (this.wires.visible = on)];
  }

  setOpacity(opacity) {
    this.opacity = opacity;
    fade(this.mesh.material, opacity);
    this.wires.material.opacity = 0.25 * opacity;
  }
}

/** A point is drawn as a square on the screen, of which the disc around it on the surface is kept. */
const DISC_VERTEX = `
  attribute float radius;
  attribute vec3 tone;
  uniform float pixelsPerUnit;
  uniform float dotSize;
  varying vec3 vTone;
  varying vec3 vNormal;
  void main() {
    vec4 inCamera = modelViewMatrix * vec4(position, 1.0);
    gl_Position = projectionMatrix * inCamera;
    gl_PointSize = dotSize > 0.0 ? dotSize : max(2.0 * radius * pixelsPerUnit * projectionMatrix[1][1] / gl_Position.w, 1.5);
    vTone = tone;
    vNormal = normalize(normalMatrix * normal);
  }`;
const DISC_FRAGMENT = `
  uniform float dotSize;
  uniform float opacity;
  uniform bool lit;
  varying vec3 vTone;
  varying vec3 vNormal;
  void main() {
    vec3 normal = vNormal.z < 0.0 ? -vNormal : vNormal;
    vec2 at = vec2(2.0, -2.0) * (gl_PointCoord - 0.5);
    float behind = dotSize > 0.0 ? 0.0 : dot(at, normal.xy) / max(normal.z, 0.25);
    if (dot(at, at) + behind * behind > 1.0) discard;
    float light = lit ? 0.35 + 0.65 * max(dot(normal, normalize(vec3(0.3, 0.8, 0.6))), 0.0) : 1.0;
    gl_FragColor = vec4(light * vTone, opacity);
    #include <colorspace_fragment>
  }`;

/** Points, each a disc on the surface or a dot. */
class PointShape {
  constructor({ count, positions, normals, colours, radii }) {
    this.count = count;
    this.normals = Float32Array.from(unpacked(normals, Int8Array), (part) => part / 127);
    this.colours = colourAttribute(unpacked(colours, Uint8Array)).array;
    const geometry = new viewer.BufferGeometry();
    geometry.setAttribute("position", new viewer.BufferAttribute(unpacked(positions, Float32Array), 3));
    geometry.setAttribute("normal", new viewer.BufferAttribute(this.normals, 3));
    geometry.setAttribute("radius", new viewer.BufferAttribute(unpacked(radii, Float32Array), 1));
    const uniforms = { pixelsPerUnit: { value: 1 }, dotSize: { value: 0 }, opacity: { value: 1 }, lit: { value: false } };
    const shaders = { vertexShader: DISC_VERTEX, fragmentShader: DISC_FRAGMENT };
    this.material = new viewer.ShaderMaterial({ uniforms, ...shaders });
    this.group = new viewer.Points(geometry, this.material);
    const size = new viewer.Vector2();
    this.group.onBeforeRender = (renderer) => {
      uniforms.pixelsPerUnit.value = renderer.getDrawingBufferSize(size).y / 2;
    };
  }

  facts() {
    return { shape: "points", points: this.count };
  }

  colourings() {
    return [
      ["colour", "Colour", "Colours of the frames"],
      ["plain", "Plain", "No colour, lit"],
      ["normals", "Normals", "Coloured by direction"],
    ];
  }

  colour(key) {
    const tones = {
      colour: () => this.colours,
      plain: () => new Float32Array(3 * this.count).fill(0.7),
      normals: () => this.normals.map((part) => (part + 1) / 2),
    }[key]();
    this.group.geometry.setAttribute("tone", new viewer.BufferAttribute(tones, 3));
    this.material.uniforms.lit.value = key === "plain";
  }

  detail() {
    const size = 2.5 * Math.min(window.devicePixelRatio, 2);
    return ["dots", (on) => (this.material.uniforms.dotSize.value = on ? size : 0)];
  }

  setOpacity(opacity) {
    this.material.uniforms.opacity.value = opacity;
    fade(this.material, opacity);
  }
}

function fade(material, opacity) {
  material.transparent = opacity < 1;
  material.opacity = opacity;
  material.visible = opacity > 0;
  material.needsUpdate = true;
}
