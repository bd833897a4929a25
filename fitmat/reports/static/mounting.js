// Mounting: ball and lobes put into a page, or a sentence and still pictures where they cannot be drawn.
"use strict";

// Puts the ball into an element, or says why there is none; returns it, for whoever looks further into it.
// Stills are pictures by the names of the models, shown where it cannot be drawn.
function mountBall(root, data, stills = {}) {
    try {
        root.ball = new Ball(root, data);
    } catch (error) {
        root.replaceChildren(made("p", {}, `The ball cannot be drawn in this browser: ${error.message}.`));
        for (const { role, name } of data.models.filter((model) => model.name in stills)) {
            const picture = made("img", { src: stills[name], alt: `Lit ball of ${name}` });
            root.append(made("figure", { class: "still" }, picture, made("figcaption", {}, role)));
        }
    }
    return root.ball;
}

// Puts the lobes of a ball's materials into an element.
function mountLobes(root, ball, curves, channels, maps = []) {
    root.lobes = new Lobes(root, ball, curves, channels, maps);
    return root.lobes;
}
