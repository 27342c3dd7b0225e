// The bar of jobs: stage, share, time and a button that stops each.
import { all, fill, h, send } from "./page.js";

const seen = new Set();   // failed jobs that were closed

export function jobBar(bar) {
  let lost = false;
  const draw = () => {
    const now = Date.now() / 1000;
    const jobs = all("job").filter((job) => ["running", "waiting"].includes(job.status) || (job.status === "failed" && !seen.has(job.id) && now - job.ended < 30));
    bar.hidden = !jobs.length && !lost;
    fill(bar, lost ? h("p", { class: "notice bad" }, "The server does not answer. If it has ended, start clutchid app again.") : null, jobs.map((job) => {
      const state = job.status === "waiting" ? "waiting for another job" : job.status === "failed" ? `failed: ${job.message.split("\n")[0]}` : job.words || "starting";
      return h("div", { class: "job" }, h("strong", {}, job.title), h("span", { class: "words", role: "status" }, state),
        job.status === "running" ? h("progress", { max: 1, "aria-label": `Progress of ${job.title}`, ...(job.share === null ? {} : { value: job.share }) }) : null,
        job.status === "running" ? h("span", { class: "hint" }, `${Math.max(0, Math.round(now - job.began))} s`) : null,
        job.status === "failed" ? h("button", { type: "button", class: "plain", onclick: () => { seen.add(job.id); draw(); } }, "Close")
          : h("button", { type: "button", class: "plain", id: `cancel-${job.id}`, onclick: () => send("DELETE", `/api/jobs/${job.id}`) }, "Cancel"));
    }));
  };
  setInterval(() => { if (!bar.hidden) draw(); }, 1000);
  return { draw, lost(is) { lost = is; draw(); } };
}
