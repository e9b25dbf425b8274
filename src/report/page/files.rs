//! The files of the case, to open or copy from beside the page.

use super::super::listing::Listed;
use crate::layout::Space;
use maud::{Markup, html};

/// A row for each kind of file, closed until it is asked for.
pub fn section(listed: &[Listed]) -> Markup {
    let files: usize = listed.iter().map(|row| row.files.len()).sum();
    html! {
        p { "The links lead to the files beside this page: they work where the whole case folder is there." }
        details {
            summary { (files) " files" }
            div class="scroll" tabindex="0" role="region" aria-label="Files" {
                table {
                    caption { "Files of this case" }
                    thead { tr { th scope="col" { "What it is" } th scope="col" { "Frame" } th scope="col" { "File" } } }
                    tbody {
                        @for row in listed {
                            tr {
                                th scope="row" { (row.what) }
                                td class="words" { (frame(row.space)) }
                                td class="words" {
                                    @for (n, file) in row.files.iter().enumerate() {
                                        @if n > 0 { br; }
                                        a href=(file) { (file) }
                                    }
                                }
                            }
                        }
                    }
                }
            } "\n"
        }
    }
}

fn frame(space: Space) -> &'static str {
    match space {
        Space::Mni => "template, rigid",
        Space::Pre => "scanner, before",
        Space::Post => "scanner, after",
        Space::Transform => "from one to another",
        Space::None => "–",
    }
}
