# SPDX-License-Identifier: MIT
# scanhead.h -> libscanhead.3: the header's first comment, then each declaration with the comment before it.
#   awk -f drivers/host/libscanhead.3.awk drivers/host/scanhead.h
# All of it stays as it is written: the header is made to be read.
function put(text) {
    gsub(/\\/, "\\e", text)
    gsub(/-/, "\\-", text)
    gsub(/'/, "\\(aq", text)
    gsub(/`/, "\\(ga", text)
    gsub(/\^/, "\\(ha", text)
    gsub(/~/, "\\(ti", text)
    if (text ~ /^\./) text = "\\&" text
    print text
}
/^#define SCANHEAD_VERSION / { version = $3; gsub(/"/, "", version) }
!/SPDX-License-Identifier/ { line[++n] = $0 }
END {
    print ".TH LIBSCANHEAD 3 \"\" \"scanhead " version "\"\n.SH NAME\nlibscanhead \\- client of a laser scanner head"
    print ".SH SYNOPSIS\n.nf\n\\fB#include <scanhead.h>\\fR"
    print "cc client.c $(pkg\\-config \\-\\-cflags \\-\\-libs libscanhead)\n.fi\n.SH DESCRIPTION\n.nf"
    for (i = 1; i <= n && line[i] !~ /^#ifndef/; i++) {
        text = line[i]
        sub(/^\/\* /, "", text)
        sub(/^ \* ?/, "", text)
        sub(/ \*\/$/, "", text)
        put(text)
    }
    print ".fi\n.SH DECLARATIONS\n.nf"
    for (; i <= n; i++) {
        if (line[i] ~ /^#ifdef __cplusplus/) { i += 2; continue }
        if (line[i] ~ /^#(ifndef|endif|include|define SCANHEAD_H$)/) continue
        if (line[i] != "" || last != "") put(line[i])
        last = line[i]
    }
    print ".fi\n.SH SEE ALSO\n\\fBscanhead\\fR(1)"
}
