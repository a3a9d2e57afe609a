// Messages to Python and back, over a web socket or through a notebook's widget: both send texts and tables.
export class Link {
  // `port` has send(message) and on("msg:custom", listener), as the model of anywidget has.
  constructor(port) {
    this.port = port;
    this.waiting = new Map();
    this.listeners = new Map();
    this.next = 1;
    port.on("msg:custom", (message) => this.take(message));
  }

  on(event, listener) { this.listeners.set(event, [...(this.listeners.get(event) ?? []), listener]); }

  // The reply to a message; an error of Python has its fields text, field and remedy.
  ask(what, fields = {}) {
    const id = this.next++;
    if (this.ended) return Promise.reject(Object.assign(new Error(this.ended), { text: this.ended }));
    return new Promise((resolve, reject) => {
      this.waiting.set(id, { resolve, reject });
      this.port.send({ id, do: what, ...fields });
    });
  }

  take(message) {
    if (message.event) {
      for (const listener of this.listeners.get(message.event) ?? []) listener(message);
      return;
    }
    const waits = this.waiting.get(message.id);
    this.waiting.delete(message.id);
    if (!waits) return;
    if (message.error) waits.reject(Object.assign(new Error(message.error.text), message.error));
    else waits.resolve(message.ok);
  }

  // Nothing will be answered any more.
  end(text) {
    this.ended = text;
    for (const { reject } of this.waiting.values()) reject(Object.assign(new Error(text), { text }));
    this.waiting.clear();
    for (const listener of this.listeners.get("end") ?? []) listener({ text });
  }
}

// The port of a page that this machine serves; messages wait until it is open.
export function socketPort(address) {
  const socket = new WebSocket(address), listeners = [], early = [];
  let ended = () => {};
  socket.addEventListener("open", () => { for (const text of early.splice(0)) socket.send(text); });
  socket.addEventListener("message", ({ data }) => { for (const listener of listeners) listener(JSON.parse(data)); });
  socket.addEventListener("close", () => ended());
  return {
    send(message) {
      const text = JSON.stringify(message);
      if (socket.readyState === WebSocket.CONNECTING) early.push(text); else socket.send(text);
    },
    on(_, listener) { listeners.push(listener); },
    onEnd(listener) { ended = listener; },
  };
}
