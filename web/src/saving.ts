/** Downloads: pictures, films, numbers, surfaces. */
import { iconButton, saveAs, say, setIcon } from "./dom";
import { npz } from "./npz";
import type { Session } from "./session";
import type { Stage } from "./view/stage";

/** A button that saves the picture; `name` without a suffix. */
export const pictureButton = (stage: Stage, name: () => string): HTMLButtonElement =>
  iconButton("camera", "Save the picture (PNG)", () => {
    stage.picture().then(
      (picture) => saveAs(picture, `${name()}.png`),
      (error) => say(error.message),
    );
  });

/** Buttons, and what ends them. Files are called after `name`. */
export function saving(session: Session, stage: Stage, name: string): { buttons: HTMLElement[]; close: () => void } {
  const file = () => `${name}-${session.shown?.index ?? 0}`;
  const frames = () => saveAs(npz(session.kept.map((i) => session.frame(i)!)), `${name}.npz`);
  const glb = async () => {
    const { surfaces } = stage;
    if (!surfaces.length) return say("This scene has no surface.");
    const { glb: made } = await import("./view/glb");
    saveAs(await made(surfaces), `${file()}.glb`);
  };
  let recorder: MediaRecorder | null = null;
  const film = () => {
    if (recorder) return recorder.stop();
    if (!("MediaRecorder" in window)) return say("This browser cannot record.");
    const parts: Blob[] = [];
    const mimeType = ["video/webm;codecs=vp9", "video/webm", "video/mp4"].find((t) => MediaRecorder.isTypeSupported(t));
    // The canvas itself lets its background through, which most players would show as black.
    const flat = document.createElement("canvas");
    flat.width = stage.canvas.width;
    flat.height = stage.canvas.height;
    flat.getContext("2d", { alpha: false });
    stage.drawn = () => stage.copy(flat);
    stage.render();
    recorder = new MediaRecorder(flat.captureStream(30), { mimeType, videoBitsPerSecond: 8e6 });
    recorder.ondataavailable = (e) => parts.push(e.data);
    recorder.onstop = () => {
      recorder = null;
      stage.drawn = () => {};
      setIcon(record, "record", "Record a film (WebM)");
      record.classList.remove("live");
      saveAs(new Blob(parts, { type: mimeType }), `${name}.${mimeType?.includes("mp4") ? "mp4" : "webm"}`);
    };
    recorder.start();
    setIcon(record, "stop", "Stop the film and save it");
    record.classList.add("live");
    session.play();
  };
  const record = iconButton("record", "Record a film (WebM)", film);
  return {
    buttons: [
      pictureButton(stage, file),
      record,
      iconButton("down", "Download the stored frames (NPZ)", frames),
      iconButton("cube", "Save the surfaces (GLB)", () => void glb()),
    ],
    close: () => recorder?.stop(),
  };
}
