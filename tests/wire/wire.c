/* SPDX-License-Identifier: MIT */
#include "tests/wire/wire.h"

#include <limits.h>

int64_t wire_now_ms(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000 + now.tv_nsec / 1000000;
}

const char *wire_program(void)
{
    const char *program = getenv("SCANHEAD");
    return program != NULL && program[0] != '\0' ? program : "build/scanhead";
}

int wire_setup(void **state)
{
    struct wire *wire = calloc(1, sizeof *wire);
    if (wire == NULL) return -1;
    strcpy(wire->dir, "/tmp/scanhead-wire-XXXXXX");
    if (mkdtemp(wire->dir) == NULL) return -1;
    signal(SIGPIPE, SIG_IGN);
    *state = wire;
    return 0;
}

const char *wire_path(const struct wire *wire, const char *name)
{
    static char path[4][352];
    static int turn;
    turn = (turn + 1) % 4;
    snprintf(path[turn], sizeof path[turn], "%s/%s", wire->dir, name);
    return path[turn];
}

int wire_empty(const struct wire *wire)
{
    DIR *dir = opendir(wire->dir);
    int n = 0;
    for (struct dirent *entry; dir != NULL && (entry = readdir(dir)) != NULL;) {
        if (strcmp(entry->d_name, ".") == 0 || strcmp(entry->d_name, "..") == 0) continue;
        remove(wire_path(wire, entry->d_name));
        n++;
    }
    if (dir != NULL) closedir(dir);
    return n;
}

static void wire_forget(struct wire *wire, pid_t pid)
{
    for (int i = 0; i < wire->n_children; i++)
        if (wire->child[i] == pid) wire->child[i] = wire->child[--wire->n_children];
}

int wire_teardown(void **state)
{
    struct wire *wire = *state;
    for (int i = 0; i < wire->n_children; i++) {
        kill(wire->child[i], SIGKILL);
        waitpid(wire->child[i], NULL, 0);
    }
    wire_empty(wire);
    int failed = rmdir(wire->dir);
    free(wire);
    return failed;
}

const char *wire_write(const struct wire *wire, const char *name, const void *data, size_t len)
{
    const char *path = wire_path(wire, name);
    FILE *f = fopen(path, "wb");
    assert_non_null(f);
    assert_int_equal(fwrite(data, 1, len, f), len);
    assert_int_equal(fclose(f), 0);
    return path;
}

const char *wire_write_text(const struct wire *wire, const char *name, const char *text)
{
    return wire_write(wire, name, text, strlen(text));
}

char *wire_read(const char *path, size_t *len)
{
    FILE *f = fopen(path, "rb");
    if (f == NULL) fail_msg("%s: %s", path, strerror(errno));
    size_t n = 0, room = 1 << 16;
    char *text = malloc(room + 1);
    for (size_t got; (got = fread(text + n, 1, room - n, f)) > 0;) {
        n += got;
        if (n == room) text = realloc(text, (room *= 2) + 1);
    }
    fclose(f);
    text[n] = '\0';
    if (len != NULL) *len = n;
    return text;
}

char *wire_read_with(const char *path, int (*has)(const char *text, const void *ctx), const void *ctx)
{
    struct pollfd slot = {.fd = inotify_init1(IN_CLOEXEC), .events = POLLIN};
    assert_true(slot.fd >= 0 && inotify_add_watch(slot.fd, path, IN_MODIFY) >= 0); /* before it is read */
    char news[4096], *text;
    while (!has(text = wire_read(path, NULL), ctx)) {
        if (poll(&slot, 1, DEADLINE_MS) != 1) fail_msg("%s stays as it is:\n%s", path, text);
        assert_true(read(slot.fd, news, sizeof news) > 0);
        free(text);
    }
    close(slot.fd);
    return text;
}

pid_t wire_fork(struct wire *wire)
{
    assert_true(wire->n_children < WIRE_MAX_CHILDREN);
    fflush(NULL);
    pid_t parent = getpid(), pid = fork();
    assert_true(pid >= 0);
    if (pid != 0) {
        wire->child[wire->n_children++] = pid;
        return pid;
    }
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (getppid() != parent) _exit(127);
    return 0;
}

pid_t wire_spawn_program(struct wire *wire, const char *program, const char *const *args, const char *out,
                         const char *err, int ready_fd)
{
    char *argv[WIRE_MAX_ARGS + 2] = {(char *)(uintptr_t)program};
    int n = 1;
    for (; args[n - 1] != NULL; n++) {
        assert_true(n < WIRE_MAX_ARGS);
        argv[n] = (char *)(uintptr_t)args[n - 1];
    }
    pid_t pid = wire_fork(wire);
    if (pid != 0) return pid;
    int null = open("/dev/null", O_RDONLY), o = open(wire_path(wire, out), O_WRONLY | O_CREAT | O_TRUNC, 0600),
        e = open(wire_path(wire, err), O_WRONLY | O_CREAT | O_TRUNC, 0600);
    /* The number is high, as 3 may be any open descriptor. */
    int ready = ready_fd >= 0 ? fcntl(ready_fd, F_DUPFD, 100) : -1;
    dup2(null, 0);
    dup2(o, 1);
    dup2(e, 2);
    for (int fd = 3; fd < 100; fd++)
        close(fd);
    if (ready >= 0) dup2(ready, 3);
    if (ready >= 0) close(ready);
    signal(SIGPIPE, SIG_DFL);
    execv(argv[0], argv);
    _exit(127);
}

/* $SCANHEAD may be scanheadd, a head to be tested. Clients and judges are then of the scanhead beside it. */
static const char *program_for(const char *command)
{
    static char path[PATH_MAX];
    static const char *const head[] = {"run", "plan", "check", "list"};
    const char *program = wire_program();
    const size_t n = strlen(program);
    if (command == NULL || n < 2 || strcmp(program + n - 2, "dd") != 0) return program;
    for (size_t i = 0; i < sizeof head / sizeof head[0]; i++)
        if (strcmp(command, head[i]) == 0) return program;
    snprintf(path, sizeof path, "%.*s", (int)n - 1, program);
    return path;
}

pid_t wire_spawn(struct wire *wire, const char *const *args, const char *out, const char *err, int ready_fd)
{
    return wire_spawn_program(wire, program_for(args[0]), args, out, err, ready_fd);
}

int wire_wait(struct wire *wire, pid_t pid)
{
    int fd = pidfd_open(pid, 0), status;
    assert_true(fd >= 0);
    struct pollfd slot = {.fd = fd, .events = POLLIN};
    int n = poll(&slot, 1, DEADLINE_MS);
    close(fd);
    if (n != 1) fail_msg("process %d did not end within %d ms", (int)pid, DEADLINE_MS);
    assert_int_equal(waitpid(pid, &status, 0), pid);
    wire_forget(wire, pid);
    return WIFEXITED(status) ? WEXITSTATUS(status) : 256 + WTERMSIG(status);
}

void wire_show(const struct wire *wire, const char *name)
{
    char *text = wire_read(wire_path(wire, name), NULL);
    printf("# %s: %s\n", name, text); /* print_message cuts long texts, and their newline */
    free(text);
}

void wire_run_program(struct wire *wire, const char *program, const char *const *args, int status)
{
    const int got = wire_wait(wire, wire_spawn_program(wire, program, args, "out", "err", -1));
    if (got != status) wire_show(wire, "err");
    assert_int_equal(got, status);
}

void wire_run(struct wire *wire, const char *const *args, int status)
{
    wire_run_program(wire, program_for(args[0]), args, status);
}

struct head head_start(struct wire *wire, const char *config, const char *const *more)
{
    struct head head = {.wire = wire};
    const char *args[WIRE_MAX_ARGS] = {"run", config, "--ready-fd", "3", "--stats", wire_path(wire, "stats.json")};
    char stats[352];
    snprintf(stats, sizeof stats, "%s", args[5]);
    args[5] = stats;
    for (int n = 6; more != NULL && *more != NULL; n++)
        args[n] = *more++;
    int ready[2];
    assert_int_equal(pipe2(ready, O_CLOEXEC), 0);
    head.pid = wire_spawn(wire, args, "head.out", "head.err", ready[1]);
    close(ready[1]);
    size_t n = 0;
    for (;;) {
        struct pollfd slot = {.fd = ready[0], .events = POLLIN};
        if (poll(&slot, 1, DEADLINE_MS) != 1) fail_msg("no ready line within %d ms", DEADLINE_MS);
        ssize_t got = read(ready[0], head.ready + n, sizeof head.ready - 1 - n);
        if (got <= 0) break;
        n += (size_t)got;
    }
    close(ready[0]);
    if (n == 0 || head.ready[n - 1] != '\n') {
        wire_show(wire, "head.err");
        fail_msg("the program ended without a ready line");
    }
    return head;
}

const char *head_endpoint(const struct head *head, const char *type)
{
    static char endpoint[256];
    char key[64];
    snprintf(key, sizeof key, "{\"type\":\"%s\",\"endpoint\":\"", type);
    const char *at = strstr(head->ready, key);
    if (at == NULL) fail_msg("no %s link in %s", type, head->ready);
    at += strlen(key);
    snprintf(endpoint, sizeof endpoint, "%.*s", (int)strcspn(at, "\""), at);
    return endpoint;
}

const char *head_link(const struct head *head, int i)
{
    static const char key[] = "\"endpoint\":\"";
    static char endpoint[256];
    const char *at = head->ready;
    for (; i >= 0 && at != NULL; i--)
        if ((at = strstr(at, key)) != NULL) at += strlen(key);
    if (at == NULL) fail_msg("no such link in %s", head->ready);
    snprintf(endpoint, sizeof endpoint, "%.*s", (int)strcspn(at, "\""), at);
    return endpoint;
}

int endpoint_port(const char *endpoint)
{
    return atoi(strrchr(endpoint, ':') + 1);
}

void head_end(struct head *head, int signal_number)
{
    if (signal_number != 0) assert_int_equal(kill(head->pid, signal_number), 0);
    int status = wire_wait(head->wire, head->pid);
    if (status != 0) wire_show(head->wire, "head.err");
    assert_int_equal(status, 0);
}

/* Returns the first value of the key after the text `from`. */
static uint64_t find_uint(const struct wire *wire, const char *from, const char *key)
{
    char *text = wire_read(wire_path(wire, "stats.json"), NULL), name[64];
    snprintf(name, sizeof name, "\"%s\":", key);
    const char *at = strstr(text, from);
    if (at != NULL) at = strstr(at, name);
    if (at == NULL) fail_msg("no %s in %s", key, text);
    uint64_t value = strtoull(at + strlen(name), NULL, 10);
    free(text);
    return value;
}

uint64_t stats_uint(const struct wire *wire, const char *key)
{
    return find_uint(wire, "{", key);
}

uint64_t stats_link_uint(const struct wire *wire, const char *key)
{
    return find_uint(wire, "\"links\":", key);
}

void stats_hash(const struct wire *wire, char hex[65])
{
    char *text = wire_read(wire_path(wire, "stats.json"), NULL);
    const char *at = strstr(text, "\"stream_sha256\":");
    if (at == NULL || sscanf(at, "\"stream_sha256\": \"%64[0-9a-f]\"", hex) != 1 || strlen(hex) != 64)
        fail_msg("no stream_sha256 in %s", text);
    free(text);
}

void wire_expect_usage(struct wire *wire, const char *const *args, const char *says)
{
    assert_int_equal(wire_wait(wire, wire_spawn(wire, args, "out", "err", -1)), 2);
    char *text = wire_read(wire_path(wire, "err"), NULL);
    if (strstr(text, says) == NULL) fail_msg("'%s' is not in: %s", says, text);
    free(text);
}

struct scanhead *client_open(const char *source)
{
    struct scanhead *sh;
    char why[256];
    if (scanhead_open(source, &sh, why, sizeof why) != SCANHEAD_OK) fail_msg("%s", why);
    return sh;
}

const char *client_ask(struct scanhead *sh, const char *command)
{
    static char reply[600];
    if (scanhead_command(sh, command, reply, sizeof reply, DEADLINE_MS) != SCANHEAD_OK)
        fail_msg("%s: %s", command, scanhead_error(sh));
    return reply;
}

void client_tell(struct scanhead *sh, const char *command)
{
    const char *reply = client_ask(sh, command);
    if (strcmp(reply, "OK") != 0) fail_msg("%s: %s", command, reply);
}

void client_next(struct scanhead *sh, struct scanhead_frame *frame)
{
    if (scanhead_next(sh, frame, DEADLINE_MS) != SCANHEAD_OK) fail_msg("%s", scanhead_error(sh));
}

void wire_soon(int64_t *since_ns, int64_t t_ns, const char *what)
{
    if (*since_ns == 0) *since_ns = t_ns;
    if (t_ns - *since_ns > SOON_MS * INT64_C(1000000))
        fail_msg("%s: not within %d ms of the head's time", what, SOON_MS);
}

int64_t client_time_ns(struct scanhead *sh)
{
    return atoll(client_ask(sh, "TIME?"));
}

int is_event(const struct scanhead_frame *frame, uint32_t code)
{
    return frame->type == SCANHEAD_EVENT && frame->event == code;
}

void client_until(struct scanhead *sh, uint32_t code, struct scanhead_frame *frame)
{
    const int64_t end_ms = wire_now_ms() + 2 * DEADLINE_MS;
    do {
        if (wire_now_ms() > end_ms) fail_msg("no event %u in %d ms", (unsigned)code, 2 * DEADLINE_MS);
        client_next(sh, frame);
    } while (!is_event(frame, code));
}

void client_until_soon(struct scanhead *sh, uint32_t code, struct scanhead_frame *frame)
{
    char what[32];
    snprintf(what, sizeof what, "event %u", (unsigned)code);
    for (int64_t since_ns = 0;;) {
        client_next(sh, frame);
        if (is_event(frame, code)) return;
        wire_soon(&since_ns, frame->t_ns, what);
    }
}

void client_wait_state(struct scanhead *sh, const char *state)
{
    int64_t end_ms = wire_now_ms() + DEADLINE_MS;
    struct scanhead_frame frame;
    while (strcmp(client_ask(sh, "HEAD:STAT?"), state) != 0) {
        if (wire_now_ms() > end_ms) fail_msg("never %s", state);
        scanhead_next(sh, &frame, 10);
    }
}

int wire_bind(int type, int *port)
{
    struct sockaddr_in at = {.sin_family = AF_INET, .sin_addr = {htonl(INADDR_LOOPBACK)}};
    socklen_t len = sizeof at;
    const int fd = socket(AF_INET, type | SOCK_CLOEXEC, 0);
    assert_int_equal(bind(fd, (struct sockaddr *)&at, sizeof at), 0);
    assert_int_equal(getsockname(fd, (struct sockaddr *)&at, &len), 0);
    *port = ntohs(at.sin_port);
    return fd;
}

int raw_try_connect(const char *endpoint)
{
    struct sockaddr_in at = {.sin_family = AF_INET, .sin_port = htons((uint16_t)endpoint_port(endpoint))};
    at.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    assert_true(fd >= 0);
    if (connect(fd, (struct sockaddr *)&at, sizeof at) == 0) return fd;
    close(fd);
    return -1;
}

int raw_connect(const char *endpoint)
{
    const int fd = raw_try_connect(endpoint);
    if (fd < 0) fail_msg("connect %s: %s", endpoint, strerror(errno));
    return fd;
}

int raw_connect_again(const char *endpoint, const char *question)
{
    const ssize_t len = (ssize_t)strlen(question);
    char byte;
    for (const int64_t end_ms = wire_now_ms() + DEADLINE_MS; wire_now_ms() < end_ms; poll(NULL, 0, 1)) {
        const int fd = raw_try_connect(endpoint);
        struct pollfd slot = {.fd = fd, .events = POLLIN};
        if (fd < 0) continue;
        if (send(fd, question, (size_t)len, MSG_NOSIGNAL) == len && poll(&slot, 1, DEADLINE_MS) == 1 &&
            recv(fd, &byte, 1, MSG_PEEK) == 1)
            return fd;
        close(fd);
    }
    fail_msg("connect %s: no answer after the reboot", endpoint);
    return -1;
}

void raw_send(int fd, const void *data, size_t len)
{
    for (size_t done = 0; done < len;) {
        ssize_t n = write(fd, (const char *)data + done, len - done);
        if (n < 0) fail_msg("write: %s", strerror(errno));
        done += (size_t)n;
    }
}

struct scanhead *client_from_fd(int fd)
{
    char source[32];
    snprintf(source, sizeof source, "fd:%d", fd);
    return client_open(source);
}
