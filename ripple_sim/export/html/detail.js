// How many of the pixels are drawn while the page plays: fewer where frames come late, and more
// again on trial, since a browser may have been busy with something else.
const LATE = 1.1; // mean time between frames over the wanted one
const MEAN_SHARE = 0.03; // of the latest frame in that mean
const LATEST = 3; // of a single frame, over the wanted time
const COARSER = 0.8; // by which the pixels along a side change
const COARSEST = 0.6; // share along a side below which it does not get coarser
const FIRST_TRIAL = 1000; // time without late frames before more pixels are tried [ms]; doubles
const LAST_TRIAL = 60000; // with each reduction up to this [ms]

class Detail {
  constructor() {
    this.share = 1; // of the pixels along a side
    this.lateness = 1;
    this.timeOnTime = 0; // [ms]
    this.trial = FIRST_TRIAL;
  }

  // Takes in that a frame came after a time [ms], and the wanted one.
  add(elapsed, wanted) {
    this.lateness += MEAN_SHARE * (Math.min(elapsed / wanted, LATEST) - this.lateness);
    this.timeOnTime += elapsed;
    if (this.lateness > LATE) {
      if (this.share > COARSEST) {
        this.share *= COARSER;
        this.trial = Math.min(2 * this.trial, LAST_TRIAL);
      }
      this.restart();
    } else if (this.share < 1 && this.timeOnTime > this.trial) {
      this.share = Math.min(this.share / COARSER, 1);
      this.restart();
    }
  }

  restart() {
    this.lateness = 1;
    this.timeOnTime = 0;
  }
}
