// A page of the viewer: MuJoCo runs in Python and sends frames as they happen; pokes, throws and
// all changes go back.
const KEPT_FRAMES = 900; // the time line goes back so far

// Frames that arrive one after the other; the latest are kept.
class StreamedFrames extends Frames {
  constructor(meta, targets) {
    super(meta, targets);
    Object.assign(this, {list: new Map(), first: 0, received: 0});
  }

  get count() {
    return this.received;
  }

  get ended() {
    return false;
  }

  async load() {
    await this.push(await bytesOf(this.tags[0].textContent));
  }

  async get(number) {
    return this.list.get(Math.max(this.first, Math.min(number, this.received - 1)));
  }

  // A chunk of one frame.
  async push(bytes) {
    const [frame] = await this.decoded(bytes);
    this.list.set(this.received++, frame);
    if (this.list.size > KEPT_FRAMES) this.list.delete(this.first++);
  }
}

// Connects a player to the program that made its page. `ui` are its controls.
function connect(player, ui) {
  const {stream} = player.meta;
  const socket = new WebSocket(
    `${location.origin.replace(/^http/, "ws")}/socket${location.search}&page=${stream.number}`,
  );
  socket.binaryType = "arraybuffer";
  socket.onmessage = ({data}) => {
    player.work = player.work.then(() =>
      typeof data === "string" ? heard(player, ui, JSON.parse(data)) : arrived(player, data),
    );
  };
  socket.onclose = () => {
    ui.say("The program has ended.");
    ui.paused(true);
  };
  player.send = (command, rest = {}) => {
    if (socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify({do: command, ...rest}));
  };
}

async function arrived(player, data) {
  await player.frames.push(await inflated(new Uint8Array(data)));
  player.newest = player.frames.count - 1;
}

async function heard(player, ui, message) {
  if (message.say) ui.say(message.say);
  if ("paused" in message) ui.paused(message.paused);
  if (message.operator) {
    ui.of("operator").value = message.operator;
    if (player.rival) player.rival.name(message.operator);
  }
  if (message.reset) {
    player.timeline.forgetAll();
    if (player.rival) player.rival.timeline.forgetAll();
    player.following = true;
  }
  if (message.chosen) ui.chosen(message.chosen);
  if (message.look) {
    Object.assign(player.targets[message.look.target], message.look.content);
    player.redraw();
  }
  if (message.motion) {
    const script = document.createElement("script");
    Object.assign(script, {
      type: "application/json",
      className: "motion",
      textContent: JSON.stringify(message.motion.content),
    });
    script.dataset.target = message.motion.target;
    document.body.append(script);
  }
  if (message.law) {
    await player.timeline.to(player.frames.count - 1);
    await player.replaceSurface(message.law.target, JSON.parse(message.law.content));
  }
  if (message.rival) await compared(player, ui, message.rival);
}

// Shows the waves of another operator beside the run's, or no longer.
async function compared(player, ui, {operator, laws}) {
  ui.of("compare").value = operator;
  if (player.rival) player.rival.end();
  player.rival = null;
  if (operator) {
    await player.timeline.to(player.frames.count - 1);
    player.rival = await rivalOf(player, operator, laws);
    player.rival.name(ui.of("operator").value);
  }
  await player.paint();
}
