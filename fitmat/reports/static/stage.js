// Puts the ball and the lobes into the page when they come near the screen, in the colours that the models have there.
fitmat.part("ball", (section, { figures }) => {
    const { ball: data, curves, channels, maps, swatches } = figures, [lit, lobes] = section.querySelectorAll("div");
    data.models.forEach(({ name }, k) => {
        const colour = `var(--model${Math.max(figures.models.indexOf(name), 0) % 4})`;
        section.style.setProperty(k === 0 ? "--one" : "--other", colour);
    });
    section.hidden = false;
    const near = new IntersectionObserver((seen) => {
        if (!seen.some(({ isIntersecting }) => isIntersecting)) return;
        near.disconnect();
        const ball = mountBall(lit, data, swatches);
        if (ball === undefined) lobes.previousElementSibling.hidden = true;
        else mountLobes(lobes, ball, curves, channels, maps);
    }, { rootMargin: "600px" });
    near.observe(section);
});
