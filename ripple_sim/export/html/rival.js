// The waves of another operator beside the waves of the run: the same loads drive both. The picture is
// drawn twice by WebGL, and the rival's is copied to a canvas of its own.

class Rival {
  // With surfaces by the number of their targets, which begin with the player's present frame.
  constructor(player, operator, surfaces) {
    this.operator = operator;
    this.surfaces = surfaces;
    this.timeline = new Timeline(player.frames, surfaces);
    this.timeline.frame = player.timeline.frame;
    this.timeline.forgetAll();
    this.canvas = document.getElementById("rival");
    this.names = document.getElementById("names");
    this.appear(true);
  }

  end() {
    for (const surface of this.surfaces) if (surface) surface.solver.free();
    this.appear(false);
  }

  appear(on) {
    document.body.classList.toggle("two", on);
    this.canvas.hidden = !on;
    this.names.hidden = !on;
  }

  // Shows the names of the run's operator and of its own.
  name(operator) {
    const [left, right] = this.names.children;
    left.textContent = operator;
    right.textContent = this.operator;
  }

  // Takes over what was drawn.
  copy(drawn) {
    Object.assign(this.canvas, {width: drawn.width, height: drawn.height});
    this.canvas.getContext("2d").drawImage(drawn, 0, 0);
  }
}

// A rival with the laws of its surfaces, by the number of their targets.
async function rivalOf(player, operator, laws) {
  const surfaces = await Promise.all(
    player.targets.map((part, target) => (laws[target] ? surfaceOf(part, target, JSON.parse(laws[target])) : null)),
  );
  surfaces.forEach((surface, target) => {
    if (surface) player.chooseSolver(surface, player.surfaces[target].solver.kind);
  });
  return new Rival(player, operator, surfaces);
}
