// Buttons, keys, sliders and the pointer.
const RATE = 30; // frames a second that it takes care to show
const REFRESH = 17; // of the screen [ms]
// of time that passes between two pictures [s]: after a rest, or where it is slow, time waits
const LONGEST_TICK = 0.1;
const DRAG_RATE = 12; // pokes a second of a pointer that stays or moves
const DRAG_SHARE = 0.35; // of a click's impulse in each of them
const TURN = 0.006; // of the camera [radians a pixel]
const LOG_RANGE = 2; // a slider's ends multiply or divide by 4: two powers of 2

function control(player) {
  const of = id => document.getElementById(id);
  const ui = {of, follow: () => follow(player, of)};
  ui.show = on => {
    player.playing = on;
    player.redraw();
    of("play").className = on ? "playing" : "";
    of("play").setAttribute("aria-label", on ? "Pause" : "Play");
  };
  ui.play = on => {
    ui.show(on);
    player.following = true;
    if (player.send) player.send(on ? "resume" : "pause");
  };
  of("hint").hidden = !player.live;
  buttons(player, ui);
  sliders(player, of);
  keys(player, ui);
  pointer(player, ui);
  programControls(player, ui);
  window.onresize = () => player.redraw();
  player.canvas.addEventListener("webglcontextlost", event => {
    event.preventDefault();
    player.lose();
  });
  player.canvas.addEventListener("webglcontextrestored", () => player.regain());
  ui.follow();
  clock(player, ui);
}

function follow(player, of) {
  const slider = of("frame");
  const last = player.frames.count - 1;
  const fps = player.meta.fps;
  slider.min = player.frames.first || 0;
  slider.max = last;
  slider.value = player.number;
  slider.hidden = last < 1;
  of("time").textContent = last < 1 ? "" : `${(player.number / fps).toFixed(2)} s`;
}

function buttons(player, ui) {
  const {of, play, follow} = ui;
  of("play").onclick = () => play(!player.playing);
  of("step").onclick = () => step(player, ui, 1);
  of("restart").onclick = async () => {
    if (player.send) player.send("reset");
    else await player.restart();
    play(true);
    follow();
  };
  let wanted = null;
  of("frame").oninput = async () => {
    // only the latest place, however fast it is dragged
    if (player.playing) play(false);
    player.following = false;
    const idle = wanted === null;
    wanted = Number(of("frame").value);
    while (idle && wanted !== null) {
      const number = wanted;
      await player.show(number);
      if (wanted === number) wanted = null;
    }
    if (idle) follow();
  };
  for (const id of ["heat", "contacts", "grid"])
    of(id).onchange = event => {
      player[id] = event.target.checked;
      player.redraw();
    };
  of("camera").onclick = () => {
    player.orbit = null;
    player.redraw();
  };
  of("picture").onclick = () => savePicture(player);
  of("full").hidden = !document.fullscreenEnabled; // as on some phones
  of("full").onclick = () =>
    document.fullscreenElement ? document.exitFullscreen() : document.documentElement.requestFullscreen();
  of("tune").onclick = () => {
    of("panel").hidden = !of("panel").hidden;
    of("tune").setAttribute("aria-expanded", String(!of("panel").hidden));
  };
}

// One frame on or back; after the end, the time of one frame.
async function step(player, ui, frames) {
  if (player.send && frames > 0) {
    player.send("step");
    player.following = true;
    return;
  }
  ui.play(false);
  const atEnd = player.live && frames > 0 && player.number >= player.frames.count - 1;
  await (atEnd ? player.liveOn(1 / player.meta.fps) : player.show(Math.round(player.number) + frames));
  ui.follow();
}

function savePicture(player) {
  player.redraw();
  const link = document.createElement("a");
  link.href = player.picture().toDataURL("image/png");
  link.download = `${document.title || "ripples"}.png`;
  link.click();
}

// The waves' sliders: powers of 2 about what the scene has.
function sliders(player, of) {
  const factor = id => 2 ** (LOG_RANGE * Number(of(id).value));
  player.strength = () => factor("impulse");
  of("waves").hidden = !player.live;
  const change = () => {
    if (player.send) {
      player.send("factors", {
        factors: {speed: factor("wave-speed"), damping: factor("damping"), stiffness: factor("stiffness")},
      });
      return;
    }
    for (const surface of player.surfaces)
      if (surface)
        surface.sliders = slidersOf(
          surface.law,
          factor("wave-speed"),
          Number(of("damping").value),
          factor("stiffness"),
        );
  };
  // the program makes new waves of it: once a slider stands
  for (const id of ["wave-speed", "damping", "stiffness"])
    of(id)[player.meta.stream ? "onchange" : "oninput"] = change;
  of("plain").onclick = () => {
    for (const id of ["impulse", "wave-speed", "damping", "stiffness"]) of(id).value = 0;
    change();
  };
}

// More damping: up to the rate that ends a wave on its way over the object; less: down to none.
function slidersOf(law, speed, damping, stiffness) {
  const mean = law.damping.reduce((sum, x) => sum + x, 0) / law.count;
  // of waves that go 0.4 texels in 1 / sqrt(rate) [1/s]
  const across = (4 * 0.4 * Math.sqrt(law.meta.rates.links)) / Math.sqrt(law.count / 6);
  return {speed, stiffness, damping: damping < 0 ? damping * mean : damping * (mean + across)};
}

function keys(player, ui) {
  const {of} = ui;
  const click = id => of(id).click();
  const actions = {
    " ": () => click("play"),
    n: () => step(player, ui, 1),
    b: () => step(player, ui, -1),
    r: () => click("restart"),
    c: () => click("heat"),
    x: () => click("contacts"),
    g: () => click("grid"),
    f: () => click("full"),
    s: () => click("picture"),
    0: () => click("camera"),
    m: () => click("tune"),
  };
  if (player.meta.stream) {
    const select = of("operator");
    const next = () => {
      select.selectedIndex = (select.selectedIndex + 1) % select.length;
      select.onchange();
    };
    Object.assign(actions, {
      t: () => click("throw"),
      o: next,
      v: () => click("record"),
      q: () => click("quit"),
    });
  }
  document.onkeydown = event => {
    const action = actions[event.key.toLowerCase()];
    const typing = event.target.matches("input[type=range], select") && event.key !== " ";
    if (!action || typing || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    action();
  };
}

// On a surface the pointer pokes it, beside it and with other buttons or two fingers it moves the camera.
function pointer(player, ui) {
  const down = new Map();
  let dragged = null;
  let latest = 0;
  let held = null;
  const place = ({clientX, clientY, currentTarget}) => {
    const box = currentTarget.getBoundingClientRect();
    return [(2 * (clientX - box.left)) / box.width - 1, 1 - (2 * (clientY - box.top)) / box.height];
  };
  const press = share => {
    const hit = dragged && player.pick(...dragged);
    if (!hit) return false;
    player.poke(hit, share * player.strength());
    ui.of("hint").className = "gone";
    latest = performance.now();
    if (!player.playing) ui.play(true);
    return true;
  };
  ui.dragging = now => {
    if (dragged && now - latest > 1000 / DRAG_RATE) press(DRAG_SHARE);
  };
  const begin = event => {
    event.currentTarget.setPointerCapture(event.pointerId);
    down.set(event.pointerId, event);
    dragged = down.size === 1 && event.button === 0 && !event.shiftKey ? place(event) : null;
    if (press(1)) return;
    held = dragged && player.send ? grabbed(player, ...dragged) : null;
    dragged = null;
  };
  const end = event => {
    if (held) player.send("drop");
    down.delete(event.pointerId);
    dragged = held = null;
  };
  const move = event => {
    ui.place = place(event);
    if (dragged) dragged = ui.place;
    else if (held) pull(player, held, ...ui.place);
    else if (down.has(event.pointerId)) moveCamera(player, down, event);
    else event.currentTarget.style.cursor = player.frame && player.pick(...place(event)) ? "pointer" : "grab";
    if (down.has(event.pointerId)) down.set(event.pointerId, event);
  };
  const zoom = event => {
    if (window.top !== window && !document.hasFocus()) return; // within another page, which scrolls
    event.preventDefault();
    player.free();
    player.orbit.distance *= Math.exp(0.001 * event.deltaY);
    player.redraw();
  };
  for (const canvas of [player.canvas, ui.of("rival")])
    Object.assign(canvas, {
      onpointerdown: begin,
      onpointermove: move,
      onpointerup: end,
      onpointercancel: end,
      onwheel: zoom,
      oncontextmenu: event => event.preventDefault(),
    });
}

// Turns the camera, or shifts it with the shift key or another button; two fingers shift and zoom.
function moveCamera(player, down, event) {
  player.free();
  const orbit = player.orbit;
  const before = down.get(event.pointerId);
  const share = 1 / down.size;
  const [dx, dy] = [event.clientX - before.clientX, event.clientY - before.clientY];
  if (event.shiftKey || event.buttons > 1 || down.size > 1) {
    const {right, up} = player.view(1);
    const scale = (1.5 * share * orbit.distance) / player.canvas.clientHeight;
    orbit.focus = add(add(orbit.focus, right, -scale * dx), up, scale * dy);
  } else {
    orbit.azimuth -= TURN * dx;
    orbit.elevation = Math.max(-1.55, Math.min(1.55, orbit.elevation + TURN * dy));
  }
  if (down.size === 2) {
    const [other] = [...down.values()].filter(each => each.pointerId !== event.pointerId);
    const far = each => Math.hypot(each.clientX - other.clientX, each.clientY - other.clientY);
    orbit.distance *= far(before) / Math.max(far(event), 1);
  }
  player.redraw();
}

// Lets time pass while it plays and is in view.
function clock(player, ui) {
  // where software draws, a frame takes most of the time between two of them
  const shortest = player.drawing.software ? 900 / RATE : 0; // [ms]
  let last = performance.now();
  let drawn = last;
  let seen = true;
  new IntersectionObserver(entries => {
    seen = entries.pop().isIntersecting;
  }).observe(player.canvas);

  // Shows what has arrived from the program.
  const showNewest = async now => {
    if (player.playing) ui.dragging(now);
    const isNew = player.following && player.newest > player.number;
    if (!isNew || now - drawn <= shortest) return;
    await player.show(player.newest);
    drawn = now;
    ui.follow();
  };

  // Goes on in the recorded run, or after its end.
  const advance = async (now, seconds, rate) => {
    ui.dragging(now);
    const next = player.number + seconds * player.meta.fps;
    const end = player.frames.count - (player.live ? 1 : 0);
    const due = player.live ? now - drawn > shortest : Math.floor(next) !== player.onCanvas;
    if (player.frames.ended && next >= end) {
      if (player.live) await liveOn(player, end, next);
      else await player.show(0);
    } else if (due) await player.show(next);
    else player.number = next;
    if (!due) return;
    player.detail.add(now - drawn, Math.max(1000 / rate, 1000 / RATE));
    drawn = now;
    ui.follow();
  };

  const tick = async now => {
    const speed = Number(ui.of("speed").value);
    const rate = speed * player.meta.fps; // recorded frames a second
    const seconds = speed * Math.min((now - last) / 1000, LONGEST_TICK);
    last = now;
    if (player.send && seen) await showNewest(now);
    else if (player.playing && seen) await advance(now, seconds, rate);
    // where the next frame is far off, the browser may rest
    const rest = player.live ? 0 : (1000 * (1 - (player.number % 1))) / rate - REFRESH;
    setTimeout(() => requestAnimationFrame(tick), player.playing ? Math.max(Math.min(rest, 100), 0) : 0);
  };
  requestAnimationFrame(tick);
}

// After the last frame the waves live on; where they rest, nothing is drawn any more.
async function liveOn(player, last, next) {
  const rests = player.surfaces.every(surface => !surface || surface.still);
  if (player.number < last) await player.show(last);
  else if (!rests) await player.liveOn((next - last) / player.meta.fps);
  if (player.resting === rests) return;
  player.resting = rests;
  player.redraw();
}

const player = new Player(document.getElementById("view"));
window.ripplePlayer = {
  player,
  longestStep: law => longestStep(law, PLAIN),
  ready: player.start().then(() => {
    control(player);
    return player;
  }),
};
window.ripplePlayer.ready.catch(error => {
  const hint = document.getElementById("hint");
  hint.hidden = false;
  hint.textContent = `This page cannot be shown: ${error.message}`;
});
