# SPDX-License-Identifier: Apache-2.0
# cmake -DSOURCES=FOLDER -DBUNDLE=FILE -DPAGE=FILE -P assemble.cmake: style, licences and bundled script into the page.
file(READ ${SOURCES}/style.css STYLE)
file(READ ${SOURCES}/licences.txt LICENCES)
file(READ ${BUNDLE} SCRIPT)
set(RUN "@RUN@") # filled in by locus-replay
configure_file(${SOURCES}/page.html.in ${PAGE} @ONLY)
