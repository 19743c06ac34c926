//! What came of an acceptance run, for people (HTML) and for machines (JUnit).
//!
//! Not here: judging. The HTML is one file that needs nothing else.
