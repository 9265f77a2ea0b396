/* Whether the files that a command is to write are apart, so that none destroys another. */
#include <limits.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

#include "firmware_sim/app/app.h"

/* Whether files that are not there yet would be made as the same one: of one name, in one folder. */
static int is_same_new(const char *a, const char *b)
{
    const char *names[] = {a, b};
    struct stat folder[2];
    for (int i = 0; i < 2; i++) {
        const char *slash = strrchr(names[i], '/');
        char path[PATH_MAX] = ".";
        if (slash != NULL) {
            const int len = (int)(slash + 1 - names[i]);
            if (len >= PATH_MAX) return 0; /* no such file can be made */
            snprintf(path, sizeof path, "%.*s", len, names[i]);
            names[i] = slash + 1;
        }
        if (stat(path, &folder[i]) != 0) return strcmp(a, b) == 0;
    }
    return strcmp(names[0], names[1]) == 0 && folder[0].st_dev == folder[1].st_dev &&
           folder[0].st_ino == folder[1].st_ino;
}

/* The same file, also under two names. Devices and pipes may be given twice, and so may -, which is standard output. */
static int is_same(const char *a, const char *b)
{
    struct stat sa, sb;
    if (a == NULL || b == NULL || strcmp(a, "-") == 0 || strcmp(b, "-") == 0) return 0;
    const int has_a = stat(a, &sa) == 0, has_b = stat(b, &sb) == 0;
    if (!has_a && !has_b) return is_same_new(a, b);
    return has_a && has_b && S_ISREG(sa.st_mode) && sa.st_dev == sb.st_dev && sa.st_ino == sb.st_ino;
}

int app_check_outputs(const struct app_input *in, const struct app_output *out, int n, struct sh_err *err)
{
    for (int i = 0; i < n; i++) {
        if (is_same(out[i].path, in->operand[0]) || is_same(out[i].path, in->scenario))
            return sh_fail(err, SH_EINPUT, "--%s %s: is read, and would be overwritten; allowed another file",
                           out[i].option, out[i].path);
        for (int k = 0; k < i; k++)
            if (is_same(out[i].path, out[k].path))
                return sh_fail(err, SH_EINPUT, "--%s %s: is the file of --%s, too; allowed another file", out[i].option,
                               out[i].path, out[k].option);
    }
    return SH_OK;
}
