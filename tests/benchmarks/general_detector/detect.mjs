// Detects things with COCO's SSD MobileNet v2 lite on the CPU (WebAssembly), for comparison only; see compare.py.
//
//     node detect.mjs MODEL_FOLDER PICTURE.ppm... > detections.json
//
// MODEL_FOLDER holds model.json and its shards. Prints what `errand detect --json` prints, with COCO's class names.

import { readFileSync } from "node:fs";
import { createRequire } from "node:module";
import path from "node:path";

const require = createRequire(path.join(process.cwd(), "package.json"));
const tf = require("@tensorflow/tfjs-core");
require("@tensorflow/tfjs-backend-cpu");
require("@tensorflow/tfjs-backend-wasm");
const { loadGraphModel } = require("@tensorflow/tfjs-converter");
const cocoSsd = require("@tensorflow-models/coco-ssd");

const MOST_DETECTIONS = 50;
const LEAST_SCORE = 0.01;

/** A model.json and its shards as TensorFlow.js loads them. */
function storedModel(folder) {
  const model = JSON.parse(readFileSync(path.join(folder, "model.json")));
  const manifest = model.weightsManifest;
  const shards = manifest.flatMap((group) => group.paths.map((name) => readFileSync(path.join(folder, name))));
  const bytes = Buffer.concat(shards);
  return {
    load: async () => ({
      modelTopology: model.modelTopology,
      weightSpecs: manifest.flatMap((group) => group.weights),
      weightData: bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.byteLength),
    }),
  };
}

/** The pixels of a binary PPM as a tensor (height, width, 3). */
function picture(file) {
  const bytes = readFileSync(file);
  const [header, width, height] = bytes.toString("latin1", 0, 64).match(/^P6\s(\d+)\s(\d+)\s255\s/);
  return tf.tensor3d(new Uint8Array(bytes.subarray(header.length)), [Number(height), Number(width), 3], "int32");
}

async function detected(model, file) {
  const pixels = picture(file);
  const begun = performance.now();
  const found = await model.detect(pixels, MOST_DETECTIONS, LEAST_SCORE);
  const ms = performance.now() - begun;
  pixels.dispose();
  const detections = found.map(({ class: name, score, bbox: [x, y, width, height] }) => ({
    class: name,
    score,
    box: [x, y, x + width, y + height],
  }));
  return { file, detections, ms };
}

const [folder, ...files] = process.argv.slice(2);
await tf.setBackend("wasm").catch(() => tf.setBackend("cpu"));
await tf.ready();
console.error(`backend ${tf.getBackend()}`);
const model = new cocoSsd.ObjectDetection("lite_mobilenet_v2");
model.model = await loadGraphModel(storedModel(folder));
const answers = [];
for (const file of files) answers.push(await detected(model, file));
console.log(JSON.stringify(answers));
