// First of all scripts: an error anywhere in the page is shown on it rather than leaving a part silently empty.
window.addEventListener('error', (event) => {
  const show = () => {
    const box = document.getElementById('errors');
    box.hidden = false;
    box.textContent += `${event.message} (line ${event.lineno})\n`;
  };
  if (document.getElementById('errors')) show();
  else document.addEventListener('DOMContentLoaded', show);
});
