// The stop button, Escape, and the watch over whether this page is live. It works without the page's websocket.
export default {
  template: `
    <div class="memo-stop-box">
      <button class="memo-stop" type="button" @click="stop" aria-describedby="memo-stop-note">STOP <kbd>Esc</kbd></button>
      <div>
        <div class="memo-stop-state" role="status" aria-live="assertive" data-testid="stop-state">{{ shown }}</div>
        <div class="memo-stop-note" id="memo-stop-note">This is no emergency stop.</div>
      </div>
    </div>`,
  props: { beat: Number, state: String, fresh_ms: Number },
  data: () => ({ failed: false, stale: false }),
  computed: {
    shown() {
      if (this.failed) return "The stop did NOT reach the robot";
      return { stopping: "stopping …", stopped: "stopped" }[this.state] || "";
    },
  },
  watch: {
    beat() {
      this.last = performance.now();
      if (this.last - this.pulsed > 400) {
        this.pulsed = this.last;
        this.$emit("pulse");
      }
    },
    state() {
      this.failed = false;
    },
  },
  mounted() {
    this.last = performance.now();
    this.pulsed = 0;
    this.presses = 0;
    this.keys = (event) => {
      if (event.key === "Escape" && !event.repeat) this.stop();
    };
    document.addEventListener("keydown", this.keys, true);
    this.timer = setInterval(() => {
      this.stale = performance.now() - this.last > this.fresh_ms;
      document.body.classList.toggle("memo-stale", this.stale);
    }, 100);
    document.querySelector(".memo-stop").memoReady = true;
  },
  unmounted() {
    document.removeEventListener("keydown", this.keys, true);
    clearInterval(this.timer);
  },
  methods: {
    stop() {
      const press = `${Date.now()}x${Math.floor(Math.random() * 1e9)}x${this.presses++}`;
      window.memoPressed = performance.timeOrigin + performance.now();
      fetch("/stop", {
        method: "POST",
        headers: { "Content-Type": "application/json" },
        body: JSON.stringify({ press }),
        keepalive: true,
        priority: "high",
        signal: AbortSignal.timeout(2000),
      })
        .then((answer) => (this.failed = !answer.ok))
        .catch(() => (this.failed = true));
      this.$emit("stop", press); // a second way, should the first be blocked
    },
  },
};
