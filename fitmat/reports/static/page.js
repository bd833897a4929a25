/* The rest of the page: buttons that copy, and folded parts that are printed unfolded. */
"use strict";
for (const button of document.querySelectorAll("button.copy")) {
  const words = button.textContent;
  button.hidden = false;
  button.addEventListener("click", () => {
    const text = button.previousElementSibling;
    const done = () => { button.textContent = "Copied"; setTimeout(() => { button.textContent = words; }, 1500); };
    const chosen = () => { getSelection().selectAllChildren(text); button.textContent = "Chosen: press Ctrl-C"; };
    if (navigator.clipboard) navigator.clipboard.writeText(text.textContent).then(done, chosen);
    else chosen();
  });
}
addEventListener("beforeprint", () => {
  for (const details of document.querySelectorAll("details")) details.open = true;
});
