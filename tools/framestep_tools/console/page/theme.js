// Light and dark, as the user chooses; the browser keeps it.

export function keepTheme(select) {
  const set = () => {
    document.documentElement.style.colorScheme = select.value;
    localStorage.setItem("theme", select.value);
  };
  select.value = localStorage.getItem("theme") ?? "light dark";
  select.addEventListener("change", set);
  set();
}
