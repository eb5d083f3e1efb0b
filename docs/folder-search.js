// Opened from a folder, a page may start no worker: the search's script then runs in a frame of the page.
if (location.protocol === "file:") {
  window.Worker = class extends EventTarget {
    constructor(url) {
      super();
      this.frame = document.createElement("iframe");
      this.frame.hidden = true;
      this.ready = new Promise((loaded) => {
        const begin = () => {
          const inside = this.frame.contentWindow;
          inside.postMessage = (data) => this.answer(data);
          inside.importScripts = () => undefined;
          const script = inside.document.createElement("script");
          script.src = url;
          script.onload = () => loaded(inside);
          inside.document.head.append(script);
        };
        const add = () => { document.body.append(this.frame); begin(); };
        document.body ? add() : addEventListener("DOMContentLoaded", add);
      });
    }
    answer(data) {
      const event = new MessageEvent("message", { data });
      this.dispatchEvent(event);
      if (this.onmessage) this.onmessage(event);
    }
    async postMessage(data) {
      const inside = await this.ready;
      inside.dispatchEvent(new inside.MessageEvent("message", { data }));
    }
    terminate() { this.frame.remove(); }
  };
}
