# SPDX-License-Identifier: Apache-2.0
# cmake -DSOURCES=FOLDER -DSTYLES=FILES -DBUNDLE=FILE -DPAGE=FILE -P assemble.cmake: inserts
# styles, licences and bundled script into the page. STYLES are separated by commas.
string(REPLACE "," ";" STYLES ${STYLES})
foreach(file ${STYLES})
  file(READ ${file} style)
  string(APPEND STYLE "${style}")
endforeach()
file(READ ${SOURCES}/licences.txt LICENCES)
file(READ ${BUNDLE} SCRIPT)
set(DATA "@DATA@") # filled in by write_data_page()
configure_file(${SOURCES}/page.html.in ${PAGE} @ONLY)
