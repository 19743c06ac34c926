//! The page's files, as the build packed them.
//!
//! Not here: their sources; those are in `www`.

/// A file of the page.
#[derive(Debug)]
pub struct Asset {
    /// Where a browser finds it, from `/`.
    pub path: &'static str,
    /// Its media type.
    pub content_type: &'static str,
    /// Its tag, quotes included: another one means another content.
    pub etag: &'static str,
    /// The file, compressed.
    pub gzip: &'static [u8],
}

/// Every file.
pub static ASSETS: &[Asset] = include!(concat!(env!("OUT_DIR"), "/assets.rs"));

/// What the address without a path means.
const INDEX: &str = "/index.html";

/// The file at a path.
pub fn find(path: &str) -> Option<&'static Asset> {
    let path = if path == "/" { INDEX } else { path };
    ASSETS.iter().find(|asset| asset.path == path)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The page shares the flash with the simulator, bytes.
    const ROOM: usize = 100 * 1024;

    #[test]
    fn the_page_fits_into_flash() {
        let sum: usize = ASSETS.iter().map(|asset| asset.gzip.len()).sum();
        assert!(sum <= ROOM, "{sum} bytes of {ROOM}");
    }

    #[test]
    fn the_page_has_an_index_and_no_file_twice() {
        assert!(find("/").is_some());
        for (i, asset) in ASSETS.iter().enumerate() {
            assert!(ASSETS[..i].iter().all(|other| other.path != asset.path));
        }
    }
}
