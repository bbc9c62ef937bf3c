// Exports: what cannot be made says why on the page; a link alone would save the reason as a file.
const SHOWN_MS = 15000;

export function watchExports(menu, notice) {
  for (const link of menu.querySelectorAll("a")) {
    link.addEventListener("click", async (event) => {
      event.preventDefault();
      menu.open = false;
      show(notice, await exported(link).catch(() => "no connection to the ground program"), link.textContent);
    });
  }
}

// Saves the file; returns "" or why there is none.
async function exported(link) {
  const answer = await fetch(link.href);
  if (!answer.ok) return (await answer.text()).trim();
  const name = /filename="?([^";]+)/.exec(answer.headers.get("Content-Disposition") ?? "")?.[1] ?? "targets";
  const url = URL.createObjectURL(await answer.blob());
  const save = document.createElement("a");
  save.href = url;
  save.download = name;
  save.click();
  setTimeout(() => URL.revokeObjectURL(url), SHOWN_MS);
  return "";
}

function show(notice, why, kind) {
  notice.textContent = why ? `${kind} cannot be made: ${why}` : "";
  notice.hidden = !why;
  clearTimeout(notice.timer);
  notice.timer = setTimeout(() => { notice.hidden = true; }, SHOWN_MS);
}
