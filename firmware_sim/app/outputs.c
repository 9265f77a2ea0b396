/* Whether the files that a command is to write are apart, so that none destroys another. */
#include <string.h>
#include <sys/stat.h>

#include "firmware_sim/app/app.h"

/* By the same name, or the same file under two names. Devices and pipes may be given twice. */
static int is_same(const char *a, const char *b)
{
    struct stat sa, sb;
    if (a == NULL || b == NULL) return 0;
    if (stat(a, &sa) != 0 || stat(b, &sb) != 0) return strcmp(a, b) == 0 && strcmp(a, "-") != 0;
    return S_ISREG(sa.st_mode) && sa.st_dev == sb.st_dev && sa.st_ino == sb.st_ino;
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
