// Controls of the viewer, beyond those of every page: they ask the program for what it does.
const MESSAGE_TIME = 5000; // for which a message is shown [ms]

function programControls(player, ui) {
  const {of} = ui;
  const {stream} = player.meta;
  let silence = 0;
  ui.say = message => {
    const hint = of("hint");
    Object.assign(hint, {hidden: false, className: "", textContent: message});
    clearTimeout(silence);
    silence = setTimeout(() => {
      hint.className = "gone";
    }, MESSAGE_TIME);
  };
  ui.paused = paused => ui.show(!paused);
  if (!stream) return;
  of("program").hidden = false;
  of("clock").hidden = true;
  for (const name of stream.operators) of("operator").add(new Option(name, name));
  choiceControls(player, ui);
  for (const name of stream.operators) of("compare").add(new Option(name, name));
  of("operator").value = stream.operator;
  for (const id of ["operator", "compare"])
    of(id).onchange = () => player.send(id, {name: of(id).value});
  of("throw").onclick = () => throwBall(player, ui);
  of("record").onclick = () => player.send("record", {camera: cameraEntry(player)});
  of("share").onclick = () => player.send("share");
  of("save").onclick = () => player.send("save", {camera: player.orbit ? roundedCamera(player) : {}});
  of("copy").onclick = () => copyCamera(player, ui);
  of("quit").onclick = () => player.send("quit");
  hideWhatIsNot(stream.commands, of);
  connect(player, ui);
  ui.paused(stream.paused);
}

// Materials and looks, of one target or of all.
function choiceControls(player, ui) {
  const {of} = ui;
  const {stream} = player.meta;
  let choices = stream.chosen;
  player.targets.forEach(({name}, number) => of("target").add(new Option(name, number)));
  of("target").parentElement.hidden = choices.length < 2;
  const show = () => {
    const number = Number(of("target").value);
    const shown = number < 0 ? choices : [choices[number]];
    for (const kind of ["preset", "look"]) {
      const names = new Set(shown.map(choice => choice[kind]));
      of(kind).value = names.size === 1 ? shown[0][kind] : "";
    }
  };
  for (const kind of ["preset", "look"]) {
    for (const name of stream[`${kind}s`]) of(kind).add(new Option(name, name));
    of(kind).onchange = () => {
      player.send(kind, {name: of(kind).value, target: Number(of("target").value)});
    };
  }
  of("target").onchange = show;
  ui.chosen = chosen => {
    choices = chosen;
    show();
  };
  show();
}

// A program that shows a loop of the user's own does less than the viewer.
function hideWhatIsNot(commands, of) {
  for (const id of ["throw", "record", "share", "save", "quit"]) of(id).hidden = !commands.includes(id);
  for (const id of ["preset", "look", "operator", "compare"])
    of(id).parentElement.hidden = !commands.includes(id);
  for (const id of ["wave-speed", "damping", "stiffness", "plain"]) {
    const control = of(id).closest("label") || of(id);
    control.hidden = !commands.includes("factors");
  }
}

// A ball from the camera at the pointer.
function throwBall(player, ui) {
  const [x, y] = ui.place || [0, 0];
  const {eye} = player.view(player.aspect);
  player.send("throw", {point: eye, way: player.way(x, y)});
}

// The view as `[camera]` of a scene file has it: the free camera of MuJoCo.
function cameraEntry(player) {
  const {back, focus, distance} = player.view(player.aspect);
  const degrees = 180 / Math.PI;
  return {
    lookat: focus,
    distance,
    azimuth: degrees * Math.atan2(-back[1], -back[0]),
    elevation: degrees * Math.asin(-back[2]),
  };
}

// The same in millimetres and tenths of degrees, with the angle of view.
function roundedCamera(player) {
  const {lookat, distance, azimuth, elevation} = cameraEntry(player);
  const rounded = (x, digits) => Number(x.toFixed(digits));
  return {
    lookat: lookat.map(x => rounded(x, 3)),
    distance: rounded(distance, 3),
    azimuth: rounded(azimuth, 1),
    elevation: rounded(elevation, 1),
    fovy: rounded(player.meta.fovy, 2),
  };
}

function copyCamera(player, ui) {
  const entries = Object.entries(roundedCamera(player));
  // JSON writes numbers and lists as TOML does
  const lines = ["[camera]", ...entries.map(([name, value]) => `${name} = ${JSON.stringify(value)}`)];
  navigator.clipboard.writeText(lines.join("\n") + "\n").then(
    () => ui.say("The camera is in the clipboard."),
    () => ui.say(lines.join("  ")),
  );
}

// The body under a place of the canvas that can move, the point in its frame, and the plane on
// which it is dragged; or null.
function grabbed(player, x, y) {
  const bodies = player.bodies();
  const {eye, back} = player.view(player.aspect);
  const way = player.way(x, y);
  const hit = touched(player.meta.parts, part => times(bodies[part.body], part.local), eye, way);
  if (!hit || hit.part.target || !player.meta.stream.movable.includes(hit.part.body)) return null;
  const local = hit.part.local;
  const place = [0, 1, 2].map(
    k => local[k] * hit.point[0] + local[4 + k] * hit.point[1] + local[8 + k] * hit.point[2] + local[12 + k],
  );
  return {body: hit.part.body, point: place, plane: {normal: back, point: add(eye, way, hit.depth)}};
}

// Pulls a body to a place of the canvas.
function pull(player, {body, point, plane}, x, y) {
  const {eye} = player.view(player.aspect);
  const way = player.way(x, y);
  const depth = dot(add(plane.point, eye, -1), plane.normal) / dot(way, plane.normal);
  player.send("drag", {body, point, way: add(eye, way, depth)});
}
