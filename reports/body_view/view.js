// Bodies in space over time: BodyView(container, motion, between) returns draw(at), which puts them where they are at
// sample `at`.  The view is turned by dragging, moved with the right button or two fingers, and zoomed with the wheel.
// three.js and its OrbitControls are (c) the three.js authors, MIT.
import * as THREE from 'three';
import { OrbitControls } from 'three/addons/controls/OrbitControls.js';

const palette = [0x2f6fb0, 0xc8553d, 0x3d8f5f, 0x8a5fa8, 0xb58a1b, 0x3a8f9a];
const longestTrail = 2000;

// Axes of cylinders and discs are along z in a body, along y in three.js.
function alongZ(geometry) {
  return geometry.rotateX(Math.PI / 2);
}

function shapeOf(body, reach) {
  const least = 0.004 * reach, [a, b, c] = body.size.map(size => Math.max(size, least));
  if (body.shape === 'box') return new THREE.BoxGeometry(a, b, c);
  if (body.shape === 'sphere') return new THREE.SphereGeometry(a, 32, 20);
  if (body.shape === 'cylinder') return alongZ(new THREE.CylinderGeometry(a, a, b, 32));
  if (body.shape === 'disc') return alongZ(new THREE.CylinderGeometry(a, a, Math.max(0.04 * a, least), 48));
  if (body.shape === 'rod') {
    const rod = new THREE.CylinderGeometry(0.012 * reach, 0.012 * reach, a, 16);
    return body.coordinates.length === 3 ? rod.rotateZ(Math.PI / 2) : alongZ(rod);  // in the plane it lies along x
  }
  if (body.size.every(size => size === 0)) return new THREE.BoxGeometry(0.12 * reach, 0.06 * reach, 0.02 * reach);
  return new THREE.SphereGeometry(1, 32, 20).scale(a, b, c);
}

// A stripe from the centre outwards, by which one sees a round body turn.
function stripe(body, reach) {
  const size = body.shape === 'rod' || body.shape === 'box' ? 0 : Math.max(body.size[0], 0.02 * reach);
  const points = [new THREE.Vector3(0, 0, 0), new THREE.Vector3(1.02 * size, 0, 0)];
  if (body.shape === 'sphere' || body.shape === 'ellipsoid')
    points.splice(0, 2, ...Array.from({ length: 25 }, (_, k) => new THREE.Vector3(
      1.01 * body.size[0] * Math.cos(k * Math.PI / 12), 0, 1.01 * (body.shape === 'sphere' ? body.size[0] : body.size[2]) *
      Math.sin(k * Math.PI / 12))));
  if (body.shape === 'disc' || body.shape === 'cylinder') {
    const up = body.shape === 'disc' ? Math.max(0.021 * body.size[0], 0.0025 * reach) : 0.505 * body.size[1];
    for (const point of points) point.z = up;
  }
  return new THREE.Line(new THREE.BufferGeometry().setFromPoints(points), new THREE.LineBasicMaterial({ color: 0xffffff }));
}

// Position and orientation of a body at a sample; quaternions are w, x, y, z in the data.
function placeOf(body, motion, between, at, mesh) {
  const value = i => between(motion.values[i], at), places = body.coordinates;
  const [x, y, z, w, i, j, k] = places.length === 0 ? body.fixed
    : places.length === 7 ? places.map(value)
      : [value(places[0]), value(places[1]), 0, Math.cos(value(places[2]) / 2), 0, 0, Math.sin(value(places[2]) / 2)];
  mesh.position.set(x, y, z);
  mesh.quaternion.set(i, j, k, w).normalize();
}

function trailOf(body, motion) {
  const [x, y, z] = body.coordinates.map(i => motion.values[i]), every = Math.ceil(x.length / longestTrail);
  const points = [];
  for (let k = 0; k < x.length; k += every) points.push(new THREE.Vector3(x[k], y[k], body.coordinates.length === 7 ? z[k] : 0));
  return points;
}

function extentOf(motion) {
  const box = new THREE.Box3();
  for (const body of motion.solids) {
    const points = body.coordinates.length ? trailOf(body, motion) : [new THREE.Vector3(...body.fixed.slice(0, 3))];
    const size = Math.max(...body.size, 0);
    for (const point of points) box.union(new THREE.Box3().setFromCenterAndSize(point, new THREE.Vector3(size, size, size)));
  }
  return box;
}

export function BodyView(container, motion, between) {
  const box = extentOf(motion), centre = box.getCenter(new THREE.Vector3());
  const reach = Math.max(box.getSize(new THREE.Vector3()).length(), 1e-6);
  const renderer = new THREE.WebGLRenderer({ antialias: true, preserveDrawingBuffer: true });
  const scene = new THREE.Scene(), camera = new THREE.PerspectiveCamera(40, 1, 0.001 * reach, 100 * reach);
  camera.up.set(0, 0, 1);
  camera.position.copy(centre).add(new THREE.Vector3(0.55, -1.15, 0.6).multiplyScalar(1.1 * reach));
  scene.add(new THREE.HemisphereLight(0xffffff, 0x667788, 2.2));
  const sun = new THREE.DirectionalLight(0xffffff, 1.6);
  sun.position.set(0.4 * reach, -0.6 * reach, reach).add(centre);
  scene.add(sun);

  const ten = 10 ** Math.floor(Math.log10(reach / 8)), cell = ten * [5, 2, 1].find(k => k * ten <= reach / 8);
  const cells = 2 * Math.ceil(reach / cell);
  const grid = new THREE.GridHelper(cells * cell, cells, 0x888888, 0xbbbbbb).rotateX(Math.PI / 2);
  grid.position.set(Math.round(centre.x / cell) * cell, Math.round(centre.y / cell) * cell, 0);
  scene.add(grid, new THREE.AxesHelper(0.12 * reach));

  const meshes = motion.solids.map((body, n) => {
    const colour = palette[n % palette.length];
    const mesh = new THREE.Mesh(shapeOf(body, reach), new THREE.MeshStandardMaterial({ color: colour, roughness: 0.6 }));
    mesh.add(stripe(body, reach));
    mesh.name = body.name;
    scene.add(mesh);
    if (body.coordinates.length)
      scene.add(new THREE.Line(new THREE.BufferGeometry().setFromPoints(trailOf(body, motion)),
        new THREE.LineBasicMaterial({ color: colour })));
    return mesh;
  });

  const canvas = renderer.domElement, controls = new OrbitControls(camera, canvas);
  controls.target.copy(centre);
  controls.update();
  canvas.style.touchAction = 'pan-y pinch-zoom';
  canvas.tabIndex = 0;
  container.append(canvas);

  const night = matchMedia('(prefers-color-scheme: dark)');
  const render = () => {
    scene.background = new THREE.Color(night.matches ? 0x20242a : 0xf6f7f9);
    renderer.render(scene, camera);
  };
  controls.addEventListener('change', render);
  night.addEventListener('change', render);
  canvas.addEventListener('keydown', event => {
    const turns = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, -0.1], ArrowDown: [0, 0.1] }[event.key];
    const zoom = { '+': 0.9, '-': 1 / 0.9 }[event.key];
    if (!turns && !zoom) return;
    event.preventDefault();
    const from = new THREE.Spherical().setFromVector3(camera.position.clone().sub(centre).applyQuaternion(toY));
    if (turns) { from.theta += turns[0]; from.phi = Math.min(Math.PI - 0.05, Math.max(0.05, from.phi + turns[1])); }
    if (zoom) from.radius *= zoom;
    camera.position.setFromSpherical(from).applyQuaternion(toY.clone().invert()).add(centre);
    controls.update();
    render();
  });
  const toY = new THREE.Quaternion().setFromUnitVectors(camera.up, new THREE.Vector3(0, 1, 0));

  const resize = () => {
    const width = Math.max(200, container.clientWidth), height = Math.round(Math.min(0.68 * width, 520));
    renderer.setPixelRatio(window.devicePixelRatio);
    renderer.setSize(width, height);
    camera.aspect = width / height;
    camera.updateProjectionMatrix();
    render();
  };
  const draw = at => {
    motion.solids.forEach((body, n) => placeOf(body, motion, between, at, meshes[n]));
    render();
  };
  draw(0);
  resize();
  return { draw, resize, camera, meshes, canvas };
}
