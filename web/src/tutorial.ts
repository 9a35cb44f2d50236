// The tutorial, with buttons that try its commands.

import chapters from "given:tutorial";

/** A command of the tutorial. */
export interface Trial {
  ask: string;
  /** The case whose texts it is about; the texts that are there if there is none. */
  example: string | null;
  /** Texts beside those of the case: a world, likelihoods. */
  world: string;
  likelihoods: string;
  options: string;
}

/** Fills the tutorial in; `onTry` is called for the command of a button. */
export function tutorial(select: HTMLSelectElement, article: HTMLElement, onTry: (trial: Trial) => void): void {
  select.append(...chapters.map(({ title }, index) => new Option(`${index + 1}. ${title}`, String(index))));
  const show = (): void => {
    const chapter = chapters[Number(select.value)];
    // Built from the project's own files.
    article.innerHTML = chapter?.html ?? "";
    for (const button of article.querySelectorAll<HTMLButtonElement>("button[data-try]")) {
      const trial = chapter?.trials[Number(button.dataset.try)];
      if (trial) button.addEventListener("click", () => onTry(trial));
    }
    article.scrollTop = 0;
  };
  select.addEventListener("change", show);
  show();
}
