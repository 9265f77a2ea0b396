/* SPDX-License-Identifier: MIT */
/* The functionfs back end with a test's files in place of the kernel's. FIFOs stand for endpoints, which the same
 * asynchronous I/O reads and writes, and a socket pair for ep0. An empty FIFO answers a read as a disabled endpoint
 * does: at once, with -EAGAIN. The guest tests have the kernel's own answers. */
#include "tests/unit/usb_host.h"
#include "tests/unit/usb_models.h"

#include <errno.h>
#include <fcntl.h>
#include <linux/usb/functionfs.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include "drivers/usb/backend.h"
#include "drivers/usb/functionfs_private.h"

enum { EP_IN = 0x81, EP_OUT = 0x02, ENOUGH = 1000000 };

struct rig {
    struct host *host;
    struct functionfs *ffs;
    const struct usb_backend_ops *ops;
    int kernel; /* the other end of ep0 */
    int acts;   /* since the last call of handle */
    char dir[40], path[60];
};

static char *file(struct rig *rig, const char *name)
{
    snprintf(rig->path, sizeof rig->path, "%s/%s", rig->dir, name);
    return rig->path;
}

/* The same device with telegrams on its IN endpoint. */
static const struct usb_endpoint_row unit_endpoints[] = {
    {.address = EP_IN, .type = USB_ENDPOINT_XFER_BULK, .packet = {64, 512, 1024}, .units = 1},
    {.address = EP_OUT, .type = USB_ENDPOINT_XFER_BULK, .packet = {64, 512, 1024}}};
static const struct usb_interface_row unit_interfaces[] = {
    {.class = 0xff, .endpoint = unit_endpoints, .n_endpoints = 2}};

/* out: the file for the OUT endpoint; NULL: a FIFO. */
static struct rig rig_open_model(const char *out, const struct usb_model *model)
{
    struct rig rig = {.ops = usb_backend_ops_get(USB_BACKEND_FUNCTIONFS), .dir = "/tmp/test_functionfs.XXXXXX"};
    struct sh_err err = {0, ""};
    int pair[2];
    assert_non_null(mkdtemp(rig.dir));
    assert_int_equal(mkfifo(file(&rig, "ep1"), 0600), 0);
    if (out != NULL)
        assert_int_equal(symlink(out, file(&rig, "ep2")), 0);
    else
        assert_int_equal(mkfifo(file(&rig, "ep2"), 0600), 0);
    rig.host = host_new(model, USB_RATE_HIGH, USB_RATE_HIGH);
    rig.ffs = calloc(1, sizeof *rig.ffs);
    assert_non_null(rig.ffs);
    rig.ffs->device = rig.host->device;
    snprintf(rig.ffs->gadget.mount, sizeof rig.ffs->gadget.mount, "%s", rig.dir);
    rig.ffs->gadget.tty_number = rig.ffs->gadget.state_fd = -1;
    rig.ffs->gadget.part = *model;
    rig.ffs->gadget.row[0] = model->interface[0];
    assert_int_equal(socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_NONBLOCK, 0, pair), 0);
    rig.ffs->ep0 = pair[0];
    rig.kernel = pair[1];
    if (ffs_pipes_open(&rig.ffs->pipes, rig.ffs->device, &rig.ffs->gadget, &err) != SH_OK) fail_msg("%s", err.text);
    assert_int_equal(ffs_console_open(&rig.ffs->console, rig.ffs->device, -1, &err), SH_OK);
    return rig;
}

static struct rig rig_open(const char *out)
{
    return rig_open_model(out, &pair_model);
}

static void rig_close(struct rig *rig)
{
    rig->ops->close(rig->ffs);
    host_free(rig->host);
    close(rig->kernel);
    unlink(file(rig, "ep1"));
    unlink(file(rig, "ep2"));
    assert_int_equal(rmdir(rig->dir), 0);
}

static int count_act(void *ctx)
{
    struct rig *rig = ctx;
    if (++rig->acts > ENOUGH) fail_msg("handle() goes on and on");
    return 1;
}

static void handle(struct rig *rig)
{
    const struct usb_owner owner = {.go_on = count_act, .ctx = rig};
    struct pollfd fds[USB_BACKEND_MAX_FDS];
    int n = rig->ops->prepare(rig->ffs, fds);
    assert_true(poll(fds, (nfds_t)n, 0) >= 0);
    rig->acts = 0;
    assert_int_equal(rig->ops->handle(rig->ffs, fds, n, &owner), SH_OK);
}

/* Runs until there is nothing to do. From then on poll(2) waits, and the processor rests. */
static void settle(struct rig *rig)
{
    for (int calls = 0; calls < 1000; calls++) {
        struct pollfd fds[USB_BACKEND_MAX_FDS];
        int n = rig->ops->prepare(rig->ffs, fds);
        if (!rig->ops->more(rig->ffs) && poll(fds, (nfds_t)n, 0) == 0) return;
        handle(rig);
    }
    fail_msg("poll(2) never waits");
}

static void event(struct rig *rig, enum usb_functionfs_event_type type)
{
    const struct usb_functionfs_event e = {.type = (uint8_t)type};
    assert_int_equal(send(rig->kernel, &e, sizeof e, 0), sizeof e);
}

static void host_sends(struct rig *rig, const char *text)
{
    int fd = open(file(rig, "ep2"), O_WRONLY | O_NONBLOCK);
    assert_true(fd >= 0);
    assert_int_equal(write(fd, text, strlen(text)), strlen(text));
    close(fd);
}

/* The host takes the configuration away, so every read comes back at once, again and again. */
static void test_deconfigured(void **state)
{
    (void)state;
    struct rig rig = rig_open(NULL);
    char text[8];
    event(&rig, FUNCTIONFS_ENABLE);
    settle(&rig); /* would go round for ever if what came back went out again */
    assert_int_equal(usb_facts(rig.host->device)->configuration, 1);
    event(&rig, FUNCTIONFS_DISABLE);
    settle(&rig);
    assert_int_equal(usb_facts(rig.host->device)->configuration, 0);
    /* The host brings it back: reads and writes go on. */
    host_sends(&rig, "abc");
    event(&rig, FUNCTIONFS_ENABLE);
    settle(&rig);
    assert_int_equal(usb_device_read(rig.host->device, EP_OUT, text, sizeof text), 3);
    assert_memory_equal(text, "abc", 3);
    assert_int_equal(usb_device_write(rig.host->device, EP_IN, "defg", 4), 4);
    settle(&rig);
    int fd = open(file(&rig, "ep1"), O_RDONLY | O_NONBLOCK);
    assert_int_equal(read(fd, text, sizeof text), 4);
    assert_memory_equal(text, "defg", 4);
    close(fd);
    rig_close(&rig);
}

/* A failure from before the present configuration does not count for this one. */
static void test_left_over(void **state)
{
    (void)state;
    struct rig rig = rig_open(NULL);
    struct ffs_pipes *pipes = &rig.ffs->pipes;
    char text[8];
    event(&rig, FUNCTIONFS_ENABLE);
    settle(&rig);
    ffs_pipes_start(pipes); /* all OUT slots fail, and their completions wait */
    host_sends(&rig, "x");
    ffs_pipes_start(pipes); /* the endpoint is up again before they are read */
    settle(&rig);
    assert_int_equal(usb_device_read(rig.host->device, EP_OUT, text, sizeof text), 1);
    rig_close(&rig);
}

/* /dev/null completes each read with no bytes, like a host that sends empty packets without end. ep0 gets its turn. */
static void test_busy_endpoint(void **state)
{
    (void)state;
    struct rig rig = rig_open("/dev/null");
    event(&rig, FUNCTIONFS_ENABLE);
    handle(&rig);
    assert_int_equal(usb_facts(rig.host->device)->configuration, 1);
    assert_true(rig.ops->more(rig.ffs)); /* completions wait, which no descriptor tells any more */
    event(&rig, FUNCTIONFS_DISABLE);
    handle(&rig);
    assert_int_equal(usb_facts(rig.host->device)->configuration, 0);
    settle(&rig);
    rig_close(&rig);
}

/* An error that does not pass: the kernel can't write to the buffers. */
static void test_failing_endpoint(void **state)
{
    (void)state;
    struct rig rig = rig_open(NULL);
    struct ffs_pipe *pipe = &rig.ffs->pipes.pipe[1];
    uint8_t *buffer[FFS_SLOTS];
    for (int i = 0; i < FFS_SLOTS; i++) {
        buffer[i] = pipe->slot[i].buffer;
        pipe->slot[i].buffer = (uint8_t *)16;
    }
    host_sends(&rig, "x");
    event(&rig, FUNCTIONFS_ENABLE);
    settle(&rig);
    for (int i = 0; i < FFS_SLOTS; i++) {
        assert_int_equal(pipe->slot[i].failures, FFS_MAX_FAILURES);
        pipe->slot[i].buffer = buffer[i];
    }
    event(&rig, FUNCTIONFS_ENABLE); /* the next configuration gives it another chance */
    settle(&rig);
    assert_int_equal(usb_device_can_read(rig.host->device, EP_OUT, NULL), 1);
    rig_close(&rig);
}

/* Failures count in a row. After a transfer that succeeded those before it are forgotten, however many there were. */
static void test_failures_long_past(void **state)
{
    (void)state;
    struct rig rig = rig_open("/dev/zero"); /* each read gets a whole buffer */
    struct ffs_pipe *pipe = &rig.ffs->pipes.pipe[1];
    static uint8_t bytes[FFS_SLOT_BYTES];
    event(&rig, FUNCTIONFS_ENABLE);
    settle(&rig);
    for (int i = 0; i < FFS_SLOTS * (FFS_MAX_FAILURES + 2); i++) {
        struct ffs_slot *slot = &pipe->slot[i % FFS_SLOTS]; /* the core takes them in this order */
        uint8_t *buffer = slot->buffer;
        slot->buffer = (uint8_t *)16; /* the kernel can't write there */
        if (usb_device_read(rig.host->device, EP_OUT, bytes, sizeof bytes) != sizeof bytes)
            fail_msg("after %d transfers the endpoint rests", i);
        slot->buffer = buffer; /* that transfer has failed; this slot's next one will not */
        settle(&rig);
        assert_int_equal(slot->failures, 0);
        assert_int_equal(slot->state, FFS_AT_CORE);
    }
    rig_close(&rig);
}

/* Nine endpoints are one too many; eight are opened, by their numbers. */
static void test_most_endpoints(void **state)
{
    (void)state;
    struct usb_endpoint_row row[FFS_MAX_PIPES + 1] = {{0}};
    struct gadget gadget = {.mount = "/tmp/test_functionfs.XXXXXX"};
    struct ffs_pipes pipes;
    struct sh_err err = {0, ""};
    char path[80];
    struct host *host = host_new(&pair_model, USB_RATE_HIGH, USB_RATE_HIGH);
    assert_non_null(mkdtemp(gadget.mount));
    for (int i = 0; i <= FFS_MAX_PIPES; i++) {
        row[i].address = (uint8_t)(i + 1);
        snprintf(path, sizeof path, "%s/ep%d", gadget.mount, i + 1);
        assert_int_equal(mkfifo(path, 0600), 0);
    }
    gadget.part.n_interfaces = 2;
    for (int more = 0; more <= 1; more++) {
        gadget.row[0] = (struct usb_interface_row){.endpoint = row, .n_endpoints = 3};
        gadget.row[1] =
            (struct usb_interface_row){.endpoint = row + 3, .n_endpoints = (uint8_t)(FFS_MAX_PIPES - 3 + more)};
        assert_int_equal(ffs_pipes_open(&pipes, host->device, &gadget, &err), more ? SH_EINPUT : SH_OK);
        for (unsigned i = 0; i <= FFS_MAX_PIPES + 1; i++)
            assert_int_equal(ffs_pipes_address(&pipes, i), !more && i >= 1 && i <= FFS_MAX_PIPES ? i : 0);
        ffs_pipes_close(&pipes);
    }
    assert_string_equal(err.text, "functionfs: too many endpoints; allowed are up to 8");
    snprintf(path, sizeof path, "%s/ep2", gadget.mount);
    unlink(path);
    assert_int_equal(ffs_pipes_open(&pipes, host->device, &gadget, &err), SH_EIO);
    assert_non_null(strstr(err.text, "/ep2: No such file or directory"));
    for (int i = 1; i <= FFS_MAX_PIPES + 1; i++) {
        snprintf(path, sizeof path, "%s/ep%d", gadget.mount, i);
        unlink(path);
    }
    assert_int_equal(rmdir(gadget.mount), 0);
    host_free(host);
}

static ssize_t endpoint_request(struct rig *rig, unsigned index, void *answer, size_t room)
{
    struct usb_functionfs_event e = {.type = FUNCTIONFS_SETUP};
    e.u.setup.bRequestType = USB_DIR_IN | USB_TYPE_VENDOR | USB_RECIP_ENDPOINT;
    e.u.setup.bRequest = 0x55;
    le_put16(&e.u.setup.wIndex, (uint16_t)index);
    le_put16(&e.u.setup.wLength, 4);
    assert_int_equal(send(rig->kernel, &e, sizeof e, 0), sizeof e);
    settle(rig);
    return recv(rig->kernel, answer, room, MSG_DONTWAIT);
}

/* The kernel (f_fs.c, ffs_func_revmap_ep) names an endpoint in wIndex by its place in our descriptors, from 1. */
static void test_endpoint_request(void **state)
{
    (void)state;
    static const unsigned address[] = {EP_IN, EP_OUT};
    struct rig rig = rig_open(NULL);
    uint8_t answer[8];
    event(&rig, FUNCTIONFS_ENABLE);
    settle(&rig);
    for (unsigned i = 0; i < 2; i++) {
        assert_int_equal(endpoint_request(&rig, i + 1, answer, sizeof answer), 4);
        assert_int_equal(answer[0], 0xc0); /* host_request() */
        assert_int_equal(le_get16(&rig.host->last.wIndex), address[i]);
    }
    const int before = rig.host->n_requests;
    assert_int_equal(endpoint_request(&rig, 3, answer, sizeof answer), -1);
    assert_int_equal(rig.host->n_requests, before);
    rig_close(&rig);
}

/* A telegram of whole packets has a packet of no bytes after it, which FunctionFS sends by a write of its own. Where
 * the telegram fills a buffer to its last byte, the next buffer has only that write. */
static void test_units(void **state)
{
    (void)state;
    static const struct {
        size_t len;
        int writes[2]; /* by the first two buffers */
    } cases[] = {{511, {1, 0}},
                 {512, {2, 0}},
                 {513, {1, 0}},
                 {1024, {2, 0}},
                 {FFS_SLOT_BYTES - 1, {1, 0}},
                 {FFS_SLOT_BYTES, {1, 1}},
                 {FFS_SLOT_BYTES + 512, {1, 2}},
                 {FFS_SLOT_BYTES + 1, {1, 1}}};
    static uint8_t telegram[FFS_SLOT_BYTES + 512], back[1 << 16];
    for (size_t i = 0; i < sizeof telegram; i++)
        telegram[i] = (uint8_t)(i * 5 + i / 256);
    struct usb_model model = pair_model;
    model.interface = unit_interfaces;
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        struct rig rig = rig_open_model(NULL, &model);
        const struct ffs_slot *slot = rig.ffs->pipes.pipe[0].slot;
        event(&rig, FUNCTIONFS_ENABLE);
        settle(&rig);
        assert_int_equal(usb_device_write(rig.host->device, EP_IN, telegram, cases[i].len), cases[i].len);
        for (int k = 0; k < 2; k++)
            if (slot[k].n_io != cases[i].writes[k])
                fail_msg("%zu bytes: %d writes by buffer %d, not %d", cases[i].len, slot[k].n_io, k,
                         cases[i].writes[k]);
        settle(&rig);
        int fd = open(file(&rig, "ep1"), O_RDONLY | O_NONBLOCK);
        assert_int_equal(read(fd, back, sizeof back), cases[i].len);
        assert_memory_equal(back, telegram, cases[i].len);
        close(fd);
        rig_close(&rig);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_deconfigured),       cmocka_unit_test(test_left_over),
        cmocka_unit_test(test_busy_endpoint),      cmocka_unit_test(test_failing_endpoint),
        cmocka_unit_test(test_endpoint_request),   cmocka_unit_test(test_units),
        cmocka_unit_test(test_failures_long_past), cmocka_unit_test(test_most_endpoints),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
