//! The page: one file with its style and its script inside. The script draws by WebGL 2 itself; one lit surface, one cut and
//! a ball are a few shaders, less than any library brings.

const MARKUP: &str = include_str!("page/page.html");
const STYLE: &str = include_str!("page/page.css");
/// One script: wire, fineness, picture, what is seen beside the body, panel.
const SCRIPT: &str = concat!(
    include_str!("page/wire.js"),
    include_str!("page/fineness.js"),
    include_str!("page/picture.js"),
    include_str!("page/sights.js"),
    include_str!("page/panel.js")
);

/// The page's text; the nonce lets its own style and script in, and no other.
pub(super) fn page(nonce: &str) -> String {
    MARKUP.replace("NONCE", nonce).replace("/*STYLE*/", STYLE).replace("/*SCRIPT*/", SCRIPT)
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_page_asks_for_nothing_from_outside() {
        // The name of a namespace is no address.
        let page = super::page("n0nce").replace("http://www.w3.org/2000/svg", "");
        for word in ["http://", "https://", "//cdn", "import(", "@import", "url("] {
            assert!(!page.contains(word), "{word}");
        }
        assert!(page.contains("nonce=\"n0nce\"") && !page.contains("/*SCRIPT*/") && !page.contains("/*STYLE*/"));
    }
}
