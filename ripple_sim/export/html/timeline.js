// The recorded run in time: what drives the waves between its frames, states to go back to, and
// what comes after its end.
const KEEP_EVERY = 24; // frames between two states that are kept
const MOST_KEPT = 64; // states: of longer runs, every second one is dropped

class Timeline {
  // `surfaces` by the number of their targets; none where a target is replayed.
  constructor(frames, surfaces) {
    Object.assign(this, {frames, surfaces});
    this.lastStep = surfaces.map(() => null); // substeps and their length [s], for what comes after the end
    this.kept = [];
    this.restart();
  }

  restart() {
    this.frame = 0; // the last one that was reached
    this.share = 0; // of the way to the next one
    this.cursors = this.surfaces.map(() => ({event: 0, substeps: 0, time: 0}));
    this.every(surface => surface.restart());
    this.keep();
  }

  every(action) {
    this.surfaces.forEach((surface, target) => surface && action(surface, target));
  }

  // Goes on to a frame, with a fraction, or back to it from the nearest state that was kept.
  async to(number) {
    if (number < this.frame + this.share) this.back(number);
    while (this.frame < Math.floor(number)) {
      this.play(await this.frames.get(this.frame + 1), Infinity);
      this.frame++;
      this.share = 0;
      this.cursors.forEach(cursor => Object.assign(cursor, {event: 0, substeps: 0, time: 0}));
      if (this.frame % KEEP_EVERY === 0) this.keep();
    }
    this.share = number - this.frame;
    if (this.share > 0 && this.frame + 1 < this.frames.count)
      this.play(await this.frames.get(this.frame + 1), this.share);
  }

  // Plays the events of a frame up to a share of its time; times are shared out by whole substeps.
  play({events}, share) {
    this.every((surface, target) => {
      if (!events[target]) return;
      const cursor = this.cursors[target];
      const steps = events[target].filter(([kind]) => kind === "step");
      const until = share * steps.reduce((sum, [, substeps, dt]) => sum + substeps * dt, 0);
      for (; cursor.event < events[target].length; cursor.event++, cursor.substeps = 0) {
        const [kind, first, second] = events[target][cursor.event];
        if (kind === "load") surface.hold(first, second);
        else if (kind === "kick") surface.kick(first, second);
        else {
          const wanted =
            share === Infinity
              ? first
              : Math.min(first, Math.round((until - cursor.time) / second) + cursor.substeps);
          const substeps = Math.max(wanted - cursor.substeps, 0);
          if (substeps) surface.step(substeps, second);
          this.lastStep[target] = second;
          cursor.substeps += substeps;
          cursor.time += substeps * second;
          if (cursor.substeps < first) return;
        }
      }
    });
  }

  // Lets the waves live on for a time [s] after the end of the run, when nothing touches them any more.
  liveOn(seconds) {
    this.every((surface, target) => {
      const dt = this.lastStep[target] || longestStep(surface.law, PLAIN);
      const cursor = this.cursors[target];
      if (surface.load.texels.length) surface.hold([], []);
      cursor.time += seconds;
      const substeps = Math.floor(cursor.time / dt);
      cursor.time -= substeps * dt;
      if (substeps) surface.step(substeps, dt);
    });
  }

  keep() {
    if (this.kept.some(({frame}) => frame === this.frame)) return;
    this.kept = this.kept.filter(({frame}) => frame >= (this.frames.first || 0));
    this.kept.push({frame: this.frame, states: this.surfaces.map(surface => surface && surface.state)});
    if (this.kept.length > MOST_KEPT) this.kept = this.kept.filter((_, i) => i % 2 === 0);
  }

  // After a poke, later states are no longer what will be.
  forget() {
    this.kept = this.kept.filter(({frame}) => frame <= this.frame);
  }

  // Nothing before the present state can be gone back to.
  forgetAll() {
    this.kept = [];
    this.keep();
  }

  back(number) {
    const {frame, states} = this.kept.filter(({frame}) => frame <= number).pop() || this.kept[0];
    this.every((surface, target) => surface.restore(states[target]));
    Object.assign(this, {frame, share: 0});
    this.cursors.forEach(cursor => Object.assign(cursor, {event: 0, substeps: 0, time: 0}));
  }
}
