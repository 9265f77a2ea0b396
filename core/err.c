/* SPDX-License-Identifier: MIT */
#include "core/err.h"

#include <stdarg.h>
#include <stdio.h>

#include "core/utf8.h"

/* Some terminals take U+0080 to U+009F for commands, too. In UTF-8 these are 0xc2 and one more byte. */
static int is_high_control(const char *c)
{
    return (unsigned char)c[0] == 0xc2 && (unsigned char)c[1] >= 0x80 && (unsigned char)c[1] < 0xa0;
}

void sh_keep_line(char *text)
{
    int len;
    for (char *c = text; *c != '\0'; c += len) {
        len = utf8_len(c, 4);
        if (is_high_control(c))
            c[0] = c[1] = '?';
        else if (len == 0 || (unsigned char)*c < ' ' || *c == 0x7f)
            *c = '?';
        if (len == 0) len = 1;
    }
}

int sh_fail(struct sh_err *err, int code, const char *fmt, ...)
{
    if (err == NULL) return code;
    va_list ap;
    va_start(ap, fmt);
    vsnprintf(err->text, sizeof err->text, fmt, ap);
    va_end(ap);
    sh_keep_line(err->text);
    err->code = code;
    return code;
}

void sh_warn(const struct sh_report *report, const char *fmt, ...)
{
    while (report != NULL && report->warn == NULL)
        report = report->rest;
    if (report == NULL) return;
    char text[512];
    va_list ap;
    va_start(ap, fmt);
    vsnprintf(text, sizeof text, fmt, ap);
    va_end(ap);
    sh_keep_line(text);
    report->warn(report->ctx, text);
}

void sh_progress(const struct sh_report *report, const char *what, double fraction)
{
    while (report != NULL && report->progress == NULL)
        report = report->rest;
    if (report != NULL) report->progress(report->ctx, what, fraction);
}

int sh_stopped(const struct sh_report *report)
{
    while (report != NULL && report->stop == NULL)
        report = report->rest;
    return report != NULL && report->stop(report->ctx);
}

int sh_fail_stopped(struct sh_err *err)
{
    return sh_fail(err, SH_ESTOPPED, "stopped while loading; no scan was run");
}

int sh_check_stop(const struct sh_report *report, struct sh_err *err)
{
    return sh_stopped(report) ? sh_fail_stopped(err) : SH_OK;
}
