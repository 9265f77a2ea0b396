/* SPDX-License-Identifier: MIT */
#include "firmware_sim/device/settings_file.h"

#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>
#include <unistd.h>

#include "core/newfile.h"
#include "drivers/protocol/protocol.h"

static const char title[] = "scanhead settings 1", of_profile[] = "profile ", end_line[] = "end";

/* A line of the file has a name, a blank, a setting, and its end. */
enum { MAX_NAMES = 8, NAME_LEN = 32, MAX_SETTING = 478, LINE_LEN = NAME_LEN + MAX_SETTING + 2 };

/* All that is stored. */
struct image {
    const char *profile;
    struct {
        char name[NAME_LEN], text[SETTINGS_FILE_TEXT];
    } part[MAX_NAMES];
    uint32_t n;
};

struct settings_file {
    const char *path;
    const struct sh_report *report;
    int fd;         /* of the file at path; locked. -1: there is no file, and none is made */
    int is_written; /* by the thread; 0: the file is only looked at, and there is no thread */
    pthread_t thread;
    pthread_mutex_t lock;
    pthread_cond_t changed;
    struct image image;
    int is_new; /* the image is not written yet */
    int failed; /* the last write did; the file has an older image */
    int ends;
    /* the thread's */
    struct image written;
    struct sh_err error; /* of the last write; code 0: it succeeded */
};

/* ---- the image */

static char *find_part(struct image *image, const char *name)
{
    for (uint32_t i = 0; i < image->n; i++)
        if (strcmp(image->part[i].name, name) == 0) return image->part[i].text;
    return NULL;
}

static char *add_part(struct image *image, const char *name)
{
    char *text = find_part(image, name);
    if (text != NULL || image->n == MAX_NAMES || strlen(name) >= NAME_LEN) return text;
    strcpy(image->part[image->n].name, name);
    return image->part[image->n++].text; /* empty, as all of the image is zeros at first */
}

static int is_printable(const char *line, size_t len)
{
    for (size_t i = 0; i < len; i++)
        if (line[i] < 0x20 || line[i] > 0x7e) return 0;
    return len > 0;
}

static int are_lines(const char *text)
{
    for (size_t n; *text != '\0'; text += n + 1) {
        n = strcspn(text, "\n");
        if (text[n] == '\0' || n > MAX_SETTING || !is_printable(text, n)) return 0;
    }
    return 1;
}

/* ---- reading */

__attribute__((format(printf, 4, 5))) static int fail_at(const struct settings_file *file, unsigned line_no,
                                                         struct sh_err *err, const char *fmt, ...)
{
    char what[160];
    va_list ap;
    va_start(ap, fmt);
    vsnprintf(what, sizeof what, fmt, ap);
    va_end(ap);
    return sh_fail(err, SH_EINPUT, "%s:%u: %s; correct it, or remove the file: nothing is stored then", file->path,
                   line_no, what);
}

/* Names are those that device_store gets: the head's own, and a protocol's. */
static int is_known(const char *name)
{
    int known = strcmp(name, "head") == 0;
    for (int id = 0; id < PROTOCOL_N && !known; id++)
        known = strcmp(name, protocol_ops_get((enum protocol_id)id)->name) == 0;
    return known;
}

/* Whether a line of text is of the same setting: "HEADER VALUE" or "name=value". */
static int has_setting(const char *text, const char *line)
{
    const size_t n = strcspn(line, " =");
    for (; *text != '\0'; text += strcspn(text, "\n") + 1)
        if (strcspn(text, " =\n") == n && strncasecmp(text, line, n) == 0) return 1;
    return 0;
}

/* Takes a line "NAME TEXT". */
static int settings_file_take_line(struct settings_file *file, unsigned line_no, char *line, struct sh_err *err)
{
    char *blank = strchr(line, ' ');
    if (blank == NULL || blank == line || blank[1] == '\0')
        return fail_at(file, line_no, err, "there must be a name, a blank and a setting, or the last line '%s'",
                       end_line);
    *blank = '\0';
    if (!is_known(line))
        return fail_at(file, line_no, err, "%.40s is no name here; allowed are head and names of protocols", line);
    char *text = add_part(&file->image, line);
    if (text == NULL)
        return fail_at(file, line_no, err, "too many names, or too long a name; allowed are %d of up to %d bytes",
                       MAX_NAMES, NAME_LEN - 1);
    const size_t len = strlen(text), more = strlen(blank + 1);
    if (more > MAX_SETTING)
        return fail_at(file, line_no, err, "too long a setting; allowed are %d characters", MAX_SETTING);
    if (len + more + 2 > SETTINGS_FILE_TEXT)
        return fail_at(file, line_no, err, "too much under one name; allowed are %d bytes", SETTINGS_FILE_TEXT - 1);
    if (has_setting(text, blank + 1))
        return fail_at(file, line_no, err, "%.60s is stored twice; allowed is one line for each setting", blank + 1);
    memcpy(text + len, blank + 1, more);
    memcpy(text + len + more, "\n", 2);
    return SH_OK;
}

static int check_head(const struct settings_file *file, unsigned line_no, const char *line, struct sh_err *err)
{
    if (line_no == 1)
        return strcmp(line, title) == 0
                   ? SH_OK
                   : sh_fail(err, SH_EINPUT,
                             "%s: is no file of stored settings: the first line must be '%s'; name another file",
                             file->path, title);
    if (strncmp(line, of_profile, sizeof of_profile - 1) != 0)
        return fail_at(file, line_no, err, "there must be '%sNAME', the head's profile", of_profile);
    line += sizeof of_profile - 1;
    return strcmp(line, file->image.profile) == 0
               ? SH_OK
               : sh_fail(err, SH_EINPUT,
                         "%s: has the settings of a head of profile %.64s, this is %s; name another file", file->path,
                         line, file->image.profile);
}

/* 1: a line, without its end; 0: end of file; or a failure. */
static int settings_file_read_line(const struct settings_file *file, FILE *in, unsigned line_no, char line[LINE_LEN],
                                   struct sh_err *err)
{
    errno = 0;
    if (fgets(line, LINE_LEN, in) == NULL)
        return ferror(in) ? sh_fail(err, SH_EIO, "%s: %s", file->path, strerror(errno)) : 0;
    const size_t len = strlen(line);
    if (len == 0 || line[len - 1] != '\n' || !is_printable(line, len - 1))
        return fail_at(file, line_no, err, "allowed are lines of 1 to %d printable characters", LINE_LEN - 2);
    line[len - 1] = '\0';
    return 1;
}

static int read_image(struct settings_file *file, FILE *in, struct sh_err *err)
{
    char line[LINE_LEN];
    unsigned line_no = 1;
    int rc, has_end = 0;
    for (; (rc = settings_file_read_line(file, in, line_no, line, err)) > 0; line_no++) {
        if (has_end) return fail_at(file, line_no, err, "nothing may follow '%s'", end_line);
        has_end = line_no > 2 && strcmp(line, end_line) == 0;
        rc = line_no <= 2 ? check_head(file, line_no, line, err)
             : has_end    ? SH_OK
                          : settings_file_take_line(file, line_no, line, err);
        if (rc != SH_OK) return rc;
    }
    if (rc == 0 && line_no > 1 && !has_end)
        return fail_at(file, line_no, err, "the last line '%s' is missing", end_line);
    return rc; /* an empty file has nothing */
}

/* ---- writing */

static int put_image(const void *source, FILE *out, struct sh_err *why)
{
    (void)why;
    const struct image *image = source;
    fprintf(out, "%s\n%s%s\n", title, of_profile, image->profile);
    for (uint32_t i = 0; i < image->n; i++)
        for (const char *at = image->part[i].text; *at != '\0'; at += strcspn(at, "\n") + 1)
            fprintf(out, "%s %.*s\n", image->part[i].name, (int)strcspn(at, "\n"), at);
    fprintf(out, "%s\n", end_line);
    return SH_OK; /* newfile looks for errors of writing */
}

/* Writes the newest image. An image that is replaced during a write is never written itself. When the file is closed,
 * this thread writes what is new, or tries a failed write once more. Then the thread ends. */
static void *settings_file_main(void *arg)
{
    struct settings_file *file = arg;
    int is_last = 0;
    pthread_mutex_lock(&file->lock);
    for (;;) {
        while (!file->is_new && !file->ends)
            pthread_cond_wait(&file->changed, &file->lock);
        if (!file->is_new && (is_last || !file->failed)) break;
        is_last = file->ends;
        file->is_new = 0;
        file->written = file->image;
        pthread_mutex_unlock(&file->lock);
        file->error = (struct sh_err){0};
        if (newfile_replace(file->path, &file->fd, put_image, &file->written, &file->error) != SH_OK)
            sh_warn(file->report, "head.settings_file: %s; the settings stored last would be lost without power",
                    file->error.text);
        pthread_mutex_lock(&file->lock);
        file->failed = file->error.code != SH_OK;
    }
    pthread_mutex_unlock(&file->lock);
    return NULL;
}

/* ---- the interface */

static struct settings_file *settings_file_new(const char *path, const char *profile, const struct sh_report *report)
{
    struct settings_file *file = calloc(1, sizeof *file);
    if (file == NULL) return NULL;
    file->path = path;
    file->report = report;
    file->image.profile = profile;
    file->fd = -1;
    pthread_mutex_init(&file->lock, NULL);
    pthread_cond_init(&file->changed, NULL);
    return file;
}

static void settings_file_free(struct settings_file *file)
{
    if (file->fd >= 0) close(file->fd);
    pthread_cond_destroy(&file->changed);
    pthread_mutex_destroy(&file->lock);
    free(file);
}

static int read_from(struct settings_file *file, struct sh_err *err)
{
    FILE *in = newfile_stream(file->fd, "r");
    if (in == NULL) return sh_fail(err, SH_EIO, "%s: %s", file->path, strerror(errno));
    const int rc = read_image(file, in, err);
    fclose(in);
    return rc;
}

/* Opens the file for reading where a head has it. */
static int open_of_a_head(struct settings_file *file, struct sh_err *err)
{
    file->fd = open(file->path, O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC);
    return file->fd >= 0 ? SH_OK : sh_fail(err, SH_EIO, "%s: %s", file->path, strerror(errno));
}

/* Checks whether a head could make the file, which is not there. */
static int check_folder(const char *path, struct sh_err *err)
{
    const int error = newfile_folder_error(path);
    if (error == 0) return SH_OK;
    return sh_fail(err, error == ENOENT ? SH_EINPUT : SH_EPERM, "%s: cannot be made: %s", path, strerror(error));
}

/* Hands the file out, or frees it after an error. */
static int hand_out(int rc, const struct sh_err *why, struct settings_file *file, struct settings_file **out,
                    struct sh_err *err)
{
    if (rc == SH_OK) {
        *out = file;
        return SH_OK;
    }
    settings_file_free(file);
    return sh_fail(err, rc, "head.settings_file: %s", why->text);
}

int settings_file_look(const char *path, const char *profile, struct settings_file **out, struct sh_err *err)
{
    struct sh_err why = {0};
    struct stat st;
    int rc;
    struct settings_file *file = settings_file_new(path, profile, NULL);
    if (file == NULL) return sh_fail(err, SH_ENOMEM, "no memory");
    if (lstat(path, &st) != 0 && errno == ENOENT) {
        rc = check_folder(path, &why);
    } else {
        rc = newfile_append(path, &file->fd, &why);
        if (rc == SH_ESTATE) rc = open_of_a_head(file, &why);
    }
    if (rc == SH_OK && file->fd >= 0) rc = read_from(file, &why);
    if (file->fd >= 0) close(file->fd); /* a head may take it now */
    file->fd = -1;
    return hand_out(rc, &why, file, out, err);
}

int settings_file_open(const char *path, const char *profile, const struct sh_report *report,
                       struct settings_file **out, struct sh_err *err)
{
    struct sh_err why = {0};
    struct settings_file *file = settings_file_new(path, profile, report);
    if (file == NULL) return sh_fail(err, SH_ENOMEM, "no memory");
    int rc = newfile_append(path, &file->fd, &why);
    if (rc == SH_OK) rc = read_from(file, &why);
    if (rc == SH_ESTATE) rc = SH_EINPUT; /* another head has it */
    if (rc == SH_OK && pthread_create(&file->thread, NULL, settings_file_main, file) != 0)
        rc = sh_fail(&why, SH_EIO, "%s: no thread", path);
    file->is_written = rc == SH_OK;
    return hand_out(rc, &why, file, out, err);
}

int settings_file_put(struct settings_file *file, const char *name, const char *text)
{
    int rc = SH_EINPUT;
    if (strlen(text) >= SETTINGS_FILE_TEXT || !are_lines(text)) return rc;
    pthread_mutex_lock(&file->lock);
    char *part = add_part(&file->image, name);
    if (part != NULL) {
        rc = SH_OK;
        file->is_new |= file->failed || strcmp(part, text) != 0;
        strcpy(part, text);
        pthread_cond_signal(&file->changed);
    }
    pthread_mutex_unlock(&file->lock);
    return rc;
}

void settings_file_get(struct settings_file *file, const char *name, char text[SETTINGS_FILE_TEXT])
{
    pthread_mutex_lock(&file->lock);
    const char *part = find_part(&file->image, name);
    snprintf(text, SETTINGS_FILE_TEXT, "%s", part != NULL ? part : "");
    pthread_mutex_unlock(&file->lock);
}

const char *settings_file_path(const struct settings_file *file)
{
    return file->path;
}

int settings_file_close(struct settings_file *file, struct sh_err *err)
{
    if (file == NULL) return SH_OK;
    if (file->is_written) {
        pthread_mutex_lock(&file->lock);
        file->ends = 1;
        pthread_cond_signal(&file->changed);
        pthread_mutex_unlock(&file->lock);
        pthread_join(file->thread, NULL);
    }
    const int rc =
        file->error.code != SH_OK ? sh_fail(err, file->error.code, "head.settings_file: %s", file->error.text) : SH_OK;
    settings_file_free(file);
    return rc;
}
