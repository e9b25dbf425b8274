(() => {
  "use strict";
  const form = document.getElementById("rating-form");
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    const ratings = {};
    for (const field of form.querySelectorAll("input[type=radio]:checked")) ratings[field.name] = field.value;
    const record = {
      format: "hgm rating 1",
      report: document.title,
      ratings,
      note: document.getElementById("rating-note").value,
    };
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob([JSON.stringify(record, null, 2) + "\n"], { type: "application/json" }));
    link.download = "rating.json";
    link.click();
    URL.revokeObjectURL(link.href);
    document.getElementById("rating-said").textContent =
      "Saved as rating.json with " + Object.keys(ratings).length + " of 6 parts rated.";
  });
})();
