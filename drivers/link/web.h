/* SPDX-License-Identifier: MIT */
/* Resources that the owner of a web link adds to the page's own files, by path. */
#ifndef DRIVERS_LINK_WEB_H
#define DRIVERS_LINK_WEB_H

#include <stddef.h>

#include "core/err.h"

struct web_body {
    const char *type; /* of the content: "application/json" */
    char *bytes;      /* malloc'd; the link releases them */
    size_t len;
};

struct web_source {
    void *ctx;
    /* path: "/scene"; query: the text after its '?', or "". Called by the thread that owns the link, whose sessions
     * wait meanwhile: it must take some milliseconds at most. SH_EINPUT with an empty err: there is nothing at that
     * path; with a text: err says what is wrong with the request. Other SH_E: the resource can't be had, and err says
     * why. */
    int (*get)(void *ctx, const char *path, const char *query, struct web_body *out, struct sh_err *err);
    void (*release)(void *ctx, char *bytes); /* of a body that was sent; NULL: free() */
};

#endif
