// three.mjs FILE.glb OUT SECONDS...: three.js in headless Chromium draws the file at these times, as OUT-SECONDS.png. three and playwright-core are
// installed in the working directory.
import { readFileSync } from 'node:fs';
import { createServer } from 'node:http';
import { createRequire } from 'node:module';
import { extname, resolve } from 'node:path';

const { chromium } = createRequire(`${process.cwd()}/`)('playwright-core');
const [file, out, ...times] = process.argv.slice(2);
const page = `<!doctype html><meta charset="utf-8"><style>body{margin:0}</style>
<script type="importmap">{"imports":{"three":"/node_modules/three/build/three.module.js","three/addons/":"/node_modules/three/examples/jsm/"}}</script>
<script type="module">
import * as THREE from 'three';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';
const renderer = new THREE.WebGLRenderer({ antialias: true, preserveDrawingBuffer: true });
renderer.setSize(innerWidth, innerHeight);
renderer.setClearColor(0xfbfaf5);
document.body.append(renderer.domElement);
const scene = new THREE.Scene();
const sun = new THREE.DirectionalLight(0xffffff, 2);
sun.position.set(1, 2, 2);
scene.add(new THREE.HemisphereLight(0xffffff, 0x99aa88, 2.2), sun);
new GLTFLoader().load('/plant.glb', (plant) => {
  scene.add(plant.scene);
  const mixer = new THREE.AnimationMixer(plant.scene);
  const last = plant.animations[0]?.duration ?? 0;
  for (const clip of plant.animations) mixer.clipAction(clip).setLoop(THREE.LoopOnce).play();
  const show = (time) => { mixer.setTime(Math.min(time, last * 0.99999)); plant.scene.updateMatrixWorld(true); };
  show(last);
  const box = new THREE.Box3(), place = new THREE.Vector3();
  plant.scene.traverse((thing) => {
    thing.frustumCulled = false;
    if (!thing.isMesh || thing.name === 'ground' || thing.matrixWorld.determinant() < 1e-12) return;
    for (let i = 0; i < thing.geometry.attributes.position.count; i += 7)
      box.expandByPoint(thing.getVertexPosition(i, place).applyMatrix4(thing.matrixWorld));
  });
  show(+new URLSearchParams(location.search).get('t'));
  const middle = box.getCenter(new THREE.Vector3()), size = box.getSize(new THREE.Vector3()).length();
  const camera = new THREE.PerspectiveCamera(35, innerWidth / innerHeight, size / 100, size * 10);
  camera.position.copy(middle).add(new THREE.Vector3(0.4, 0.25, 1.5).multiplyScalar(size));
  camera.lookAt(middle);
  renderer.render(scene, camera);
  document.title = 'done: ' + last + ' s, ' + renderer.info.render.calls + ' draw calls';
}, undefined, (error) => { document.title = 'failed: ' + error; });
</script>`;
const server = createServer((request, response) => {
  const path = new URL(request.url, 'http://localhost').pathname;
  const script = path.startsWith('/node_modules/') && !path.includes('..');
  try {
    const body = path === '/' ? page : path === '/plant.glb' ? readFileSync(file) : script ? readFileSync(resolve(`.${path}`)) : null;
    if (body === null) throw new Error(path);
    response.writeHead(200, { 'content-type': extname(path) === '.js' ? 'text/javascript' : path === '/' ? 'text/html' : 'model/gltf-binary' });
    response.end(body);
  } catch {
    response.writeHead(404).end();
  }
}).listen(0, '127.0.0.1');
const browser = await chromium.launch({
  executablePath: process.env.CHROMIUM ?? '/usr/bin/chromium',
  args: ['--no-sandbox', '--use-gl=angle', '--use-angle=swiftshader', '--enable-unsafe-swiftshader'],
});
const view = await browser.newPage({ viewport: { width: 420, height: 560 } });
let failed = false;
for (const time of times) {
  await view.goto(`http://127.0.0.1:${server.address().port}/?t=${time}`);
  await view.waitForFunction(() => /^(done|failed)/.test(document.title), null, { timeout: 60000 });
  const title = await view.title();
  console.log(`${file} at ${time} s: ${title}`);
  failed ||= !title.startsWith('done');
  await view.screenshot({ path: `${out}-${time}.png` });
}
await browser.close();
server.close();
process.exit(failed ? 1 : 0);
