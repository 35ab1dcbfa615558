# SPDX-License-Identifier: Apache-2.0
# cmake -DSOURCES=FOLDER -DREPORT=FOLDER -DBUNDLE=FILE -DPAGE=FILE -P assemble.cmake: styles, licences and bundled script
# into the page.
file(READ ${REPORT}/style.css REPORT_STYLE)
file(READ ${SOURCES}/style.css OWN_STYLE)
set(STYLE "${REPORT_STYLE}${OWN_STYLE}")
file(READ ${SOURCES}/licences.txt LICENCES)
file(READ ${BUNDLE} SCRIPT)
set(RESULTS "@RESULTS@") # filled in by locus-experiments
configure_file(${SOURCES}/page.html.in ${PAGE} @ONLY)
