// The program's text beside the picture, for pages without an editor. Only the lines in sight are in the page.

const HEIGHT = 18;
/** Browsers show nothing beyond some ten million pixels; longer texts are scrolled in larger steps. */
const TALLEST = 8_000_000;

export class Listing {
  readonly element = document.createElement("div");
  private readonly space = document.createElement("div");
  private readonly window = document.createElement("div");
  private lines: string[] = [];
  private marked = -1;

  constructor(chosen: (line: number) => void) {
    this.element.className = "listing";
    this.element.tabIndex = 0;
    this.window.className = "window";
    this.space.append(this.window);
    this.element.append(this.space);
    this.element.addEventListener("scroll", () => this.draw());
    this.window.addEventListener("click", (event) => {
      const line = (event.target as HTMLElement).closest<HTMLElement>("[data-line]")?.dataset.line;
      if (line) chosen(Number(line));
    });
    new ResizeObserver(() => this.draw()).observe(this.element);
  }

  show(text: string) {
    this.lines = text.split(/\r\n|\n|\r/);
    this.space.style.height = `${Math.min(this.lines.length * HEIGHT, TALLEST)}px`;
    this.draw();
  }

  mark(line: number, scroll: boolean) {
    this.marked = line;
    const visible = this.element.clientHeight / HEIGHT;
    const first = this.element.scrollTop / (HEIGHT * this.ratio());
    if (scroll && (line < first || line > first + visible - 2)) {
      this.element.scrollTop = (line - visible / 2) * HEIGHT * this.ratio();
    }
    this.draw();
  }

  /** Pixels of the page per pixel of text. */
  private ratio(): number {
    return Math.min(1, TALLEST / Math.max(this.lines.length * HEIGHT, 1));
  }

  private draw() {
    const top = this.element.scrollTop;
    const visible = Math.ceil(this.element.clientHeight / HEIGHT) + 1;
    const most = Math.max(0, this.lines.length - visible + 2);
    const first = Math.min(Math.floor(top / (HEIGHT * this.ratio())), most);
    this.window.style.transform = `translateY(${top}px)`;
    const rows = [];
    for (let i = first; i < Math.min(first + visible, this.lines.length); i++) {
      const row = document.createElement("div");
      row.dataset.line = String(i);
      row.className = i === this.marked ? "row marked" : "row";
      const number = document.createElement("i");
      number.textContent = String(i + 1);
      row.append(number, this.lines[i]);
      rows.push(row);
    }
    this.window.replaceChildren(...rows);
  }
}
