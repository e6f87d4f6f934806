// MCAP files of tumbler record, of records and of logs, read by the reference reader and compared with the tables of the same run.
//
//   node read_back_test.mjs PROGRAMS SOURCES PACKAGES
//
// PROGRAMS is the folder of the programs, SOURCES that of the project, PACKAGES that of node_modules.

import assert from "node:assert/strict";
import { spawn, spawnSync } from "node:child_process";
import fs from "node:fs";
import { createRequire } from "node:module";
import os from "node:os";
import path from "node:path";
import { after, test } from "node:test";

const [programs, sources, packages] = process.argv.slice(2).map((name) => path.resolve(name));
const load = createRequire(path.join(packages, "package.json"));
const { McapIndexedReader, McapStreamReader } = load("@mcap/core");
const protobuf = load("protobufjs");
const { FileDescriptorSet } = load("protobufjs/ext/descriptor");
const foxglove = load("@foxglove/schemas/internal");

const folder = fs.mkdtempSync(path.join(os.tmpdir(), "tumbler-mcap-"));
after(() => fs.rmSync(folder, { recursive: true }));
const at = (name) => path.join(folder, name);
const source = (name) => path.join(sources, name);

/** Runs a command such as `tumbler run`. */
function run(command, ...options) {
  const [program, ...words] = command.split(" ");
  const done = spawnSync(path.join(programs, program), [...words, ...options], { encoding: "utf8", cwd: folder });
  return { status: done.status, text: done.stdout + done.stderr };
}
function runWell(program, ...options) {
  const done = run(program, ...options);
  assert.equal(done.status, 0, done.text);
  return done.text;
}

/** All messages of a file by topic, as {time, message}; its schemas by topic; its statistics. */
async function readMcap(name) {
  const file = await fs.promises.open(name);
  try {
    const readable = {
      size: async () => BigInt((await file.stat()).size),
      read: async (offset, length) => {
        const bytes = new Uint8Array(Number(length));
        await file.read(bytes, 0, Number(length), Number(offset));
        return bytes;
      },
    };
    const reader = await McapIndexedReader.Initialize({ readable });
    const schemas = {};
    const types = {};
    for (const channel of reader.channelsById.values()) {
      const schema = reader.schemasById.get(channel.schemaId);
      assert.equal(schema.encoding, "protobuf");
      assert.equal(channel.messageEncoding, "protobuf");
      schemas[channel.topic] = schema.name;
      const root = protobuf.Root.fromDescriptor(FileDescriptorSet.decode(schema.data));
      types[channel.topic] = root.lookupType(schema.name);
    }
    const topics = {};
    for await (const message of reader.readMessages()) {
      const { topic } = reader.channelsById.get(message.channelId);
      const type = types[topic];
      const decoded = type.toObject(type.decode(message.data), { longs: Number, enums: String, defaults: true });
      (topics[topic] ??= []).push({ time: message.logTime, message: decoded });
    }
    const metadata = {};
    for await (const texts of reader.readMetadata()) metadata[texts.name] = Object.fromEntries(texts.metadata);
    return { topics, schemas, types, metadata, statistics: reader.statistics };
  } finally {
    await file.close();
  }
}

/** The rows of a table as objects. */
function readCsv(name) {
  const [header, ...rows] = fs.readFileSync(name, "utf8").trimEnd().split("\n").map((line) => line.split(","));
  return rows.map((row) => Object.fromEntries(row.map((cell, i) => [header[i], cell])));
}
const nanoseconds = (seconds) => BigInt(Math.round(Number(seconds) * 1e9));

// One gait on the simulated bus, with the twin's truth.
const gait = source("primitives/nominal/gait.toml");
runWell("tumbler run", "sim", gait, "--cycles", "1", "--branch", "roll", "--record", at("gait.rec"), "--log",
  at("gait.lcm"), "--truth", at("truth.lcm"));
runWell("tumbler record", at("gait.rec"), "--mcap", at("gait.mcap"), "--csv", at("gait.csv"), "--truth-csv",
  at("truth.csv"));
const file = await readMcap(at("gait.mcap"));
const ticks = readCsv(at("gait.csv"));
const truths = readCsv(at("truth.csv"));
const joints = ["leg1", "leg2"];

/** The transforms that are in force at a time, by child frame. */
function transformsAt(read, time) {
  const frames = {};
  for (const { time: logged, message } of read.topics["/tf"]) {
    if (logged > time) break;
    for (const transform of message.transforms) frames[transform.child_frame_id] = transform;
  }
  return frames;
}
/** The angle of a rotation about -y, which turns +x towards +z. */
function pitchOf(q) {
  assert.equal(Math.abs(q.x), 0);
  assert.equal(Math.abs(q.z), 0);
  return 2 * Math.atan2(-q.y, q.w);
}
/** How far two angles are apart, whole turns aside. */
function apart(a, b) {
  const turn = 2 * Math.PI;
  return Math.abs(a - b - turn * Math.round((a - b) / turn));
}
/** A point of a frame in the world. */
function inWorld(frames, frame, point) {
  if (frame === "world") return point;
  const { parent_frame_id: parent, translation: t, rotation: q } = frames[frame];
  const { x, y, z } = point;
  // v + 2 w (u x v) + 2 u x (u x v)
  const c = { x: q.y * z - q.z * y, y: q.z * x - q.x * z, z: q.x * y - q.y * x };
  const d = { x: q.y * c.z - q.z * c.y, y: q.z * c.x - q.x * c.z, z: q.x * c.y - q.y * c.x };
  const turned = (k) => point[k] + 2 * q.w * c[k] + 2 * d[k] + t[k];
  return inWorld(frames, parent, { x: turned("x"), y: turned("y"), z: turned("z") });
}

test("A gait has the topics and types that the page about them lists", () => {
  const listed = {};
  for (const [, topics, type] of fs.readFileSync(source("docs/foxglove.md"), "utf8")
    .matchAll(/^\| (`\/[^|]*`) \| `((?:foxglove|tumbler)\.\w+)` \|/gm)) {
    for (const [, topic] of topics.matchAll(/`([^`]+)`/g)) listed[topic] = type;
  }
  const expected = {};
  for (const [topic, type] of Object.entries(listed)) {
    for (const joint of topic.includes("JOINT") ? joints : [""]) expected[topic.replace("JOINT", joint)] = type;
  }
  assert.deepEqual(file.schemas, expected);
});

test("The commands of the page work", () => {
  fs.mkdirSync(at("page"));
  fs.symlinkSync(source("primitives"), at("page/primitives"));
  const commands = fs.readFileSync(source("docs/foxglove.md"), "utf8").match(/^ {4}tumbler .*$/gm);
  assert.equal(commands.length, 4);
  const done = spawnSync("sh", ["-ec", commands.join("\n")],
    { encoding: "utf8", cwd: at("page"), env: { ...process.env, PATH: `${programs}:${process.env.PATH}` } });
  assert.equal(done.status, 0, done.stdout + done.stderr);
  assert.deepEqual(fs.readdirSync(at("page")).sort(), ["gait.lcm", "gait.mcap", "gait.rec", "log.mcap", "primitives"]);
});

test("Foxglove's own types have the fields, numbers and enumerations of Foxglove's own schemas", () => {
  const ours = protobuf.Root.fromJSON(file.types["/tf"].root.toJSON()).lookup("foxglove");
  const names = ours.nestedArray.map((type) => type.name);
  assert.ok(names.length >= 19, names.join());
  const kind = (type, field) => [field.id, field.name, field.type.replace(/^\.?(foxglove\.)?/, "").split(".").pop(),
    Boolean(field.repeated)];
  for (const type of ours.nestedArray) {
    const schema = foxglove.foxgloveMessageSchemas[type.name];
    const enums = Object.values(foxglove.foxgloveEnumSchemas).filter((e) => e.parentSchemaName === type.name);
    const root = protobuf.parse(foxglove.generateProto(schema, enums), { keepCase: true }).root;
    const theirs = root.lookupType(`foxglove.${type.name}`);
    assert.deepEqual(type.fieldsArray.map((f) => kind(type, f)), theirs.fieldsArray.map((f) => kind(theirs, f)), type.name);
    for (const nested of theirs.nestedArray) {
      assert.deepEqual({ ...type.lookupEnum(nested.name).values }, { ...nested.values }, `${type.name}.${nested.name}`);
    }
  }
});

test("The true robot's transforms at three times are those of the table of its true states", () => {
  for (const share of [0.1, 0.5, 0.9]) {
    const truth = truths[Math.round(share * truths.length)];
    const frames = transformsAt(file, nanoseconds(truth.time_s));
    const root = frames["true/middle"];
    assert.equal(root.parent_frame_id, "world");
    assert.equal(root.translation.x, Number(truth.root_x_m));
    assert.equal(root.translation.y, 0);
    assert.equal(root.translation.z, Number(truth.root_z_m));
    assert.ok(apart(pitchOf(root.rotation), Number(truth.root_pitch_rad)) < 1e-12, truth.time_s);
    for (const joint of joints) {
      const leg = frames[`true/${joint}_link`];
      assert.equal(leg.parent_frame_id, "true/middle");
      assert.ok(apart(pitchOf(leg.rotation), Number(truth[`${joint}_position_rad`])) < 1e-12, joint);
    }
  }
  const moved = truths.map((truth) => Number(truth.root_x_m));
  assert.ok(Math.max(...moved) - Math.min(...moved) > 0.3, "the robot did not go anywhere");
});

test("The measured robot's transforms at three times are those of the table of ticks, on the true root", () => {
  for (const share of [0.1, 0.5, 0.9]) {
    const tick = ticks[Math.round(share * ticks.length)];
    const frames = transformsAt(file, nanoseconds(tick.time_s));
    for (const joint of joints) {
      const leg = frames[`measured/${joint}_link`];
      assert.equal(leg.parent_frame_id, "true/middle");
      assert.ok(apart(pitchOf(leg.rotation), Math.fround(tick[`${joint}_measured_position_rad`])) < 1e-12, joint);
    }
    assert.equal(frames["measured/middle"], undefined);
  }
});

test("While it runs, the planned robot's joints are where the setpoints are", () => {
  let checked = 0;
  const times = new Map(file.topics["/tf"].flatMap(({ time, message }) => message.transforms
    .filter((t) => t.child_frame_id.startsWith("planned/leg")).map((t) => [`${time} ${t.child_frame_id}`, t])));
  for (const tick of ticks) {
    if (tick.state !== "running") continue;
    for (const joint of joints) {
      const leg = times.get(`${nanoseconds(tick.time_s)} planned/${joint}_link`);
      if (leg === undefined) continue;
      assert.ok(apart(pitchOf(leg.rotation), Number(tick[`${joint}_planned_position_rad`])) < 0.01, tick.time_s);
      ++checked;
    }
  }
  assert.ok(checked > 500, `${checked} were compared`);
});

test("At the end the drawn robot rests on the drawn ground, in the compliant layer of the contact law", () => {
  const time = file.statistics.messageEndTime;
  const frames = transformsAt(file, time);
  const [{ message: scene }] = file.topics["/scene/true"];
  let lowest = Infinity;
  for (const entity of scene.entities) {
    for (const sphere of entity.spheres) {
      lowest = Math.min(lowest, inWorld(frames, entity.frame_id, sphere.pose.position).z - sphere.size.z / 2);
    }
  }
  const [{ message: ground }] = file.topics["/scene/ground"];
  const top = Math.max(...ground.entities[0].triangles[0].points.map((point) => point.z));
  const [, layer] = fs.readFileSync(source("primitives/tasks/nominal/roll.toml"), "utf8").match(/^d_on_m = (\S+)/m);
  assert.ok(lowest > top && lowest < top + Number(layer), `lowest point at ${lowest} m, ground at ${top} m`);
});

test("Ticks and joints have every number of the table, but none that was not measured", () => {
  assert.equal(file.topics["/tick"].length, ticks.length);
  const same = (cell, value, type, where) => {
    if (type === "string") return assert.equal(value, cell, where);
    if (cell === "") return assert.ok(Number.isNaN(value), where);
    const number = cell === "true" ? 1 : cell === "false" ? 0 : Number(cell);
    assert.equal(type === "float" ? Math.fround(value) : value, type === "float" ? Math.fround(number) : number, where);
  };
  for (let i = 0; i < ticks.length; i += 53) {
    const columns = new Set(Object.keys(ticks[i]));
    for (const [topic, prefix] of [["/tick", ""], ...joints.map((joint) => [`/joint/${joint}`, `${joint}_`])]) {
      const { time, message } = file.topics[topic][i];
      assert.equal(time, nanoseconds(ticks[i].time_s));
      for (const field of file.types[topic].fieldsArray) {
        if (field.name === "timestamp" || field.name === "following_error_rad") continue;
        const column = prefix + field.name;
        assert.ok(columns.delete(column), `the table has no ${column}`);
        if (field.name === "time_s") continue;  // rounded in the table
        if (ticks[i][`${prefix}reply_age_ticks`] === "-1" && /^measured_|^temperature_c$/.test(field.name)) {
          assert.ok(Number.isNaN(message[field.name]), `tick ${i}, ${column}, which nobody measured`);
          continue;
        }
        same(ticks[i][column], message[field.name], field.type, `tick ${i}, ${column}`);
      }
    }
    assert.deepEqual([...columns], []);
  }
});

test("A following error is the measured position less the setpoint that it answers", () => {
  let checked = 0;
  for (let i = 1; i < ticks.length; ++i) {
    for (const joint of joints) {
      const error = file.topics[`/joint/${joint}`][i].message.following_error_rad;
      if (ticks[i].state === "disarmed" || ticks[i].state === "arming") {
        assert.ok(Number.isNaN(error));
      } else if (ticks[i][`${joint}_reply_age_ticks`] === "0" && ticks[i - 1].state === "running") {
        const expected = Math.fround(ticks[i][`${joint}_measured_position_rad`]) -
          Math.fround(ticks[i - 1][`${joint}_limited_position_rad`]);
        assert.equal(error, expected);
        ++checked;
      }
    }
  }
  assert.ok(checked > 1000, `${checked} were compared`);
});

test("Units and meanings of fields are in the file, for people", () => {
  assert.match(file.metadata.fields["Joint.planned_torque_nm"], /^\[N m\] feed-forward$/);
  assert.equal(file.metadata.run.motion, gait);
});

test("Events are a log, and latencies and the bus's load are those of the run", () => {
  const texts = file.topics["/log"].map(({ message }) => message.message);
  assert.ok(texts.some((text) => text.includes("disarmed -> arming")), texts.join("\n"));
  assert.ok(file.topics["/log"].every(({ message }) => message.level === "INFO"));
  const last = file.topics["/run"].at(-1).message;
  assert.equal(last.ticks, ticks.length);
  assert.ok(file.topics["/run"].some(({ message }) => message.bus_load > 0.1 && message.bus_load < 1));
});

test("All checksums, counts and indexes of a file hold", () => {
  const reader = new McapStreamReader({ validateCrcs: true });
  reader.append(fs.readFileSync(at("gait.mcap")));
  const counts = {};
  for (let record; (record = reader.nextRecord()) !== undefined;) {
    counts[record.type] = (counts[record.type] ?? 0) + 1;
    if (record.type === "Footer") assert.notEqual(record.summaryCrc, 0);
    if (record.type === "DataEnd") assert.notEqual(record.dataSectionCrc, 0);
    if (record.type === "Chunk") assert.notEqual(record.uncompressedCrc, 0);
  }
  assert.ok(reader.done());
  const messages = Object.values(file.topics).reduce((sum, list) => sum + list.length, 0);
  assert.equal(counts.Message, messages);
  assert.equal(file.statistics.messageCount, BigInt(messages));
  assert.equal(file.statistics.chunkCount, counts.ChunkIndex);
  assert.ok(counts.ChunkIndex > 3, "the file is too short to be in chunks");
});

test("The same record gives the same bytes", () => {
  runWell("tumbler record", at("gait.rec"), "--mcap", at("again.mcap"));
  assert.ok(fs.readFileSync(at("gait.mcap")).equals(fs.readFileSync(at("again.mcap"))));
});

test("The telemetry's log gives the same ticks, joints and events as the record", async () => {
  runWell("tumbler record", at("gait.lcm"), "--mcap", at("log.mcap"));
  const log = await readMcap(at("log.mcap"));
  assert.deepEqual(Object.keys(log.topics).sort(), ["/joint/leg1", "/joint/leg2", "/log", "/run", "/tick"]);
  for (const topic of ["/tick", "/log", "/joint/leg1", "/joint/leg2"]) {
    assert.equal(log.topics[topic].length, file.topics[topic].length, topic);
    for (let i = 0; i < log.topics[topic].length; i += topic === "/log" ? 1 : 101) {
      assert.deepEqual(log.topics[topic][i], file.topics[topic][i]);
    }
  }
});

test("A log with the truth in it shows the robot of the motion where it was, and one without it where its joints were",
  async () => {
    // lcm-logger writes all channels into one file.
    fs.writeFileSync(at("both.lcm"), Buffer.concat([fs.readFileSync(at("gait.lcm")), fs.readFileSync(at("truth.lcm"))]));
    runWell("tumbler record", at("both.lcm"), "--mcap", at("both.mcap"), "--motion", gait);
    const both = await readMcap(at("both.mcap"));
    const truth = truths[Math.round(truths.length / 2)];
    const root = transformsAt(both, nanoseconds(truth.time_s))["true/middle"];
    assert.equal(root.translation.x, Number(truth.root_x_m));
    runWell("tumbler record", at("gait.lcm"), "--mcap", at("joints.mcap"), "--motion", gait);
    const alone = await readMcap(at("joints.mcap"));
    const frames = transformsAt(alone, nanoseconds(truth.time_s));
    assert.deepEqual(Object.keys(frames).sort(), ["measured/leg1_link", "measured/leg2_link"]);
    assert.equal(frames["measured/leg1_link"].parent_frame_id, "measured/middle");
  });

/** How far the planned robot's frames are from the true one's at most: metres between roots, angles of all links. */
function planFromTruth(read) {
  const now = {};
  const worst = { root_m: 0, angle_rad: 0, compared: 0 };
  for (const { message } of read.topics["/tf"]) {
    for (const transform of message.transforms) now[transform.child_frame_id] = transform;
    for (const [frame, planned] of Object.entries(now)) {
      const truth = now[frame.replace("planned/", "true/")];
      if (!frame.startsWith("planned/") || truth === undefined) continue;
      const { x, y, z } = planned.translation;
      worst.root_m = Math.max(worst.root_m,
        Math.hypot(x - truth.translation.x, y - truth.translation.y, z - truth.translation.z));
      worst.angle_rad = Math.max(worst.angle_rad, apart(pitchOf(planned.rotation), pitchOf(truth.rotation)));
      ++worst.compared;
    }
  }
  return worst;
}

test("Before the first motion the planned robot rests where the run begins, or is not drawn where a sensor chooses", async () => {
  const run = ["sim", source("primitives/gait.toml"), "--cycles", "0", "--branch", "roll"];
  const chosen = ["--drives", source("primitives/robots/tumbler_drives_sensor.toml")];
  for (const [name, options] of [["told", ["--from", "rise"]], ["sensed", chosen]]) {
    runWell("tumbler run", ...run, ...options, "--mcap", at(`${name}.mcap`));
    const read = await readMcap(at(`${name}.mcap`));
    const begins = read.topics["/tick"].find(({ message }) => message.state === "running").time;
    const before = transformsAt(read, begins - 1n);
    const planned = before["planned/middle"];
    if (name === "sensed") {
      assert.equal(planned, undefined);
      assert.ok("planned/middle" in transformsAt(read, begins));
      continue;
    }
    assert.ok(apart(pitchOf(planned.rotation), pitchOf(before["true/middle"].rotation)) < 0.1);
  }
});

test("Joints without a motor have a truth, frames, and carry what is measured", async () => {
  runWell("tumbler optimize", source("tests/data/tasks/whip.toml"), "--quiet", "--out", at("whip.toml"));
  runWell("tumbler run", "sim", at("whip.toml"), "--record", at("whip.rec"));
  runWell("tumbler record", at("whip.rec"), "--mcap", at("whip.mcap"), "--truth-csv", at("whip.csv"));
  const read = await readMcap(at("whip.mcap"));
  const rows = readCsv(at("whip.csv"));
  let most = 0;
  for (const share of [0.3, 0.5, 0.7, 0.9]) {
    const row = rows[Math.round(share * rows.length)];
    const time = nanoseconds(row.time_s);
    const frames = transformsAt(read, time);
    assert.ok(apart(pitchOf(frames["true/upper"].rotation), Number(row.pin_position_rad)) < 1e-9, row.time_s);
    assert.equal(frames["true/lower"].parent_frame_id, "true/upper");
    assert.equal(frames["measured/lower"].parent_frame_id, "true/upper", "no drive measures where it is");
    assert.equal(frames["measured/upper"], undefined);
    assert.ok("planned/upper" in frames);
    const { message } = read.topics["/truth"].find((truth) => truth.time === time);
    assert.deepEqual(message.joints.map((joint) => joint.name), ["elbow", "pin"]);
    assert.equal(message.joints[1].velocity_rad_s, Number(row.pin_velocity_rad_s));
    most = Math.max(most, Math.abs(Number(row.pin_position_rad)));
  }
  assert.ok(most > 0.1, `it swings by ${most} rad`);
});

test("The plan is about where the simulated robot goes, also of a robot whose root has no shape", async () => {
  const motion = fs.readFileSync(source("primitives/nominal/handstand.toml"), "utf8");
  const [middle] = motion.match(/<link name="middle">[^]*?<\/link>/);
  const bare = middle.replace(/<(visual|collision)>[^]*?<\/\1>/g, "");
  assert.notEqual(bare, middle);
  fs.writeFileSync(at("bare.toml"), motion.replace(middle, bare));
  runWell("tumbler sign", at("bare.toml"), "--because", "nothing is drawn of the root");
  runWell("tumbler run", "sim", at("bare.toml"), "--record", at("bare.rec"));
  runWell("tumbler record", at("bare.rec"), "--mcap", at("bare.mcap"));
  for (const read of [file, await readMcap(at("bare.mcap"))]) {
    const { root_m, angle_rad, compared } = planFromTruth(read);
    assert.ok(compared > 1000, `${compared} frames`);
    assert.ok(root_m < 0.05 && angle_rad < 0.15, `${root_m} m, ${angle_rad} rad`);
  }
});

/** The record without its blocks of one kind, which then counts as damaged. */
function withoutBlocks(record, kind) {
  const kept = [record.subarray(0, 16)];
  for (let offset = 16; offset + 24 <= record.length;) {
    const size = 24 + record.readUInt32LE(offset + 12);
    if (record.readUInt32LE(offset + 4) !== kind) kept.push(record.subarray(offset, offset + size));
    offset += size;
  }
  return Buffer.concat(kept);
}

/** CRC-32 as in zlib. */
function crc32(bytes) {
  let crc = ~0;
  for (const byte of bytes) {
    crc ^= byte;
    for (let bit = 0; bit < 8; ++bit) crc = (crc >>> 1) ^ (crc & 1 ? 0xedb88320 : 0);
  }
  return ~crc >>> 0;
}

test("The imagined drives of a dry run have measured nothing", async () => {
  // The first block is the configuration; it and its header are given the checksums that they then have.
  const record = fs.readFileSync(at("gait.rec"));
  const content = record.subarray(40, 40 + record.readUInt32LE(28));
  const key = content.indexOf('"dry_run": false');
  assert.ok(key > 0);
  content.write('"dry_run": true ', key);
  record.writeUInt32LE(crc32(content), 32);
  record.writeUInt32LE(crc32(record.subarray(16, 36)), 36);
  fs.writeFileSync(at("dry.rec"), record);
  run("tumbler record", at("dry.rec"), "--mcap", at("dry.mcap"));
  const dry = await readMcap(at("dry.mcap"));
  assert.equal(dry.metadata.run.dry_run, "yes");
  assert.equal(dry.topics["/tick"].length, ticks.length);
  assert.equal(dry.topics["/scene/measured"], undefined);
  assert.ok(!Object.keys(transformsAt(dry, dry.statistics.messageEndTime)).some((frame) => frame.startsWith("measured/")));
  for (const field of ["following_error_rad", "measured_position_rad", "measured_torque_nm", "temperature_c"]) {
    assert.ok(dry.topics["/joint/leg1"].every(({ message }) => Number.isNaN(message[field])), field);
  }
});

test("Where nothing is known of the true robot, the measured joints are on the planned root", async () => {
  fs.writeFileSync(at("no_truth.rec"), withoutBlocks(fs.readFileSync(at("gait.rec")), 6));
  const done = run("tumbler record", at("no_truth.rec"), "--mcap", at("no_truth.mcap"));
  assert.equal(done.status, 4, done.text);
  const read = await readMcap(at("no_truth.mcap"));
  assert.equal(read.topics["/tick"].length, ticks.length);
  assert.equal(read.topics["/truth"], undefined);
  const frames = transformsAt(read, read.statistics.messageEndTime);
  assert.equal(frames["true/middle"], undefined);
  assert.equal(frames["measured/leg1_link"].parent_frame_id, "planned/middle");
  const refused = run("tumbler record", at("no_truth.rec"), "--truth-csv", at("no_truth.csv"));
  assert.equal(refused.status, 1);
  assert.match(refused.text, /has no true states of the robot/);
  assert.ok(!fs.existsSync(at("no_truth.csv")));
});

test("A record that was cut off is written up to there, and one without its configuration is refused", async () => {
  const record = fs.readFileSync(at("gait.rec"));
  fs.writeFileSync(at("cut.rec"), record.subarray(0, record.length / 2));
  runWell("tumbler record", at("cut.rec"), "--mcap", at("cut.mcap"));
  const { length } = (await readMcap(at("cut.mcap"))).topics["/tick"];
  assert.ok(length > 1000 && length < ticks.length, `${length} ticks`);
  for (const [name, bytes, message] of [["short.rec", record.subarray(0, 900), /short\.rec: /],
    ["empty.rec", Buffer.alloc(0), /empty\.rec: /], ["other.rec", fs.readFileSync(gait), /other\.rec: /]]) {
    fs.writeFileSync(at(name), bytes);
    const done = run("tumbler record", at(name), "--mcap", at("refused.mcap"));
    assert.equal(done.status, 1, done.text);
    assert.match(done.text, message);
    assert.ok(!fs.existsSync(at("refused.mcap")));
  }
});

test("No output replaces an input or another output", () => {
  const before = fs.readFileSync(at("gait.rec"));
  for (const options of [["gait.rec", "--mcap", "./gait.rec"], ["gait.rec", "--mcap", "x.out", "--csv", "x.out"]]) {
    const done = run("tumbler record", ...options);
    assert.equal(done.status, 1, done.text);
  }
  assert.equal(run("tumbler record", "gait.lcm", "--mcap", "gait.lcm").status, 1);
  fs.copyFileSync(gait, at("motion.toml"));
  assert.equal(run("tumbler record", "gait.lcm", "--motion", "motion.toml", "--mcap", "motion.toml").status, 1);
  assert.equal(run("tumbler record", "gait.lcm", "--motion", gait).status, 1);
  assert.ok(before.equals(fs.readFileSync(at("gait.rec"))));
  assert.ok(!fs.existsSync(at("x.out")));
});

test("A file that cannot be whole is not there, and the one before it stays", () => {
  fs.mkdirSync(at("full"));
  fs.writeFileSync(at("full/run.mcap"), "before");
  const limited = spawnSync("sh", ["-c", 'ulimit -f 2000; exec "$0" "$@"', path.join(programs, "tumbler"),
    "record", at("gait.rec"), "--mcap", at("full/run.mcap")], { encoding: "utf8" });
  assert.equal(limited.status, 1, limited.stderr);
  assert.match(limited.stderr, /run\.mcap: could not be written whole/);
  assert.deepEqual(fs.readdirSync(at("full")), ["run.mcap"]);
  assert.equal(fs.readFileSync(at("full/run.mcap"), "utf8"), "before");
  assert.match(run("tumbler record", at("gait.rec"), "--mcap", at("full")).text, /is a directory/);
});

test("Ctrl-C in the middle leaves nothing behind", async () => {
  fs.mkdirSync(at("ended"));
  const child = spawn(path.join(programs, "tumbler"), ["record", at("gait.rec"), "--mcap", at("ended/run.mcap")]);
  const ended = new Promise((resolve) => child.on("exit", (status, signal) => resolve({ status, signal })));
  // The file is open under no name while it is written.
  const writes = () => {
    try {
      return fs.readdirSync(`/proc/${child.pid}/fd`)
        .some((fd) => fs.readlinkSync(`/proc/${child.pid}/fd/${fd}`).startsWith(`${at("ended")}/`));
    } catch {
      return false;
    }
  };
  while (child.exitCode === null && !writes()) await new Promise(setImmediate);
  child.kill("SIGINT");
  const { status } = await ended;
  // On a slow machine it may have been done before the signal came.
  assert.deepEqual(fs.readdirSync(at("ended")), status === 0 ? ["run.mcap"] : []);
});
