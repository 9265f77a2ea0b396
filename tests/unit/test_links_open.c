/* SPDX-License-Identifier: MIT */
/* Links as they are opened: whom the user is warned of, and what protocols get to know of the head. */
#include "tests/unit/device_rig.h"
#include "tests/unit/plain_source.h"

#include "drivers/usb/backend.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/loop/loop_inside.h"

static char warned[1024];
static int n_warned;

static void keep_warning(void *ctx, const char *text)
{
    (void)ctx;
    snprintf(warned, sizeof warned, "%s", text);
    n_warned++;
}

static const struct sh_report report = {.warn = keep_warning};

/* Opens the links of the configuration. NULL: it failed, and err says why. */
static struct loop *open_links(const struct config *cfg, struct sh_err *err)
{
    static struct plain_source plain;
    const struct loop_source source = {&plain_source_ops, &plain};
    const struct loop_options options = {.report = &report};
    struct loop *loop = NULL;
    n_warned = 0;
    return loop_create_of(cfg, &source, &options, &loop, err) == SH_OK ? loop : NULL;
}

/* A head keeps no secret. An address is judged as it is written: the loopback's in another form counts as one that
 * others may reach. A link of NMEA sentences takes no commands. */
static void a_link_that_others_reach_is_warned_of(void **state)
{
    (void)state;
    static const struct {
        const char *address;
        enum link_type type;
        enum protocol_id protocol;
        int warns;
    } rows[] = {{"", LINK_TCP, PROTOCOL_NATIVE, 0},
                {"127.0.0.1", LINK_TCP, PROTOCOL_NATIVE, 0},
                {"127.1.2.3", LINK_WEB, PROTOCOL_NATIVE, 0},
                {"localhost", LINK_TCP, PROTOCOL_NATIVE, 0},
                {"::1", LINK_TCP, PROTOCOL_NATIVE, 0},
                {"0:0:0:0:0:0:0:1", LINK_TCP, PROTOCOL_NATIVE, 1},
                {"0:0:0:0:0:0:0:1", LINK_WEB, PROTOCOL_NATIVE, 1},
                {"0:0:0:0:0:0:0:1", LINK_TCP, PROTOCOL_SCIP, 1},
                {"0:0:0:0:0:0:0:1", LINK_TCP, PROTOCOL_COLA, 1},
                {"0:0:0:0:0:0:0:1", LINK_TCP, PROTOCOL_NMEA, 0}};
    struct rig *rig = rig_open(NULL, NULL, 0);
    rig->cfg->n_links = 1;
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct link_spec *spec = &rig->cfg->link[0];
        struct sh_err err;
        *spec = (struct link_spec){.type = rows[i].type, .protocol = (int)rows[i].protocol, .max_sessions = 1};
        snprintf(spec->address, sizeof spec->address, "%s", rows[i].address);
        struct loop *loop = open_links(rig->cfg, &err);
        if (loop == NULL && strchr(rows[i].address, ':') != NULL) continue; /* this machine has no IPv6 */
        if (loop == NULL) fail_msg("%s: %s", rows[i].address, err.text);
        if (n_warned != rows[i].warns) fail_msg("row %zu, %s: %d warnings", i, rows[i].address, n_warned);
        static const char open[] = "other machines can reach and command it: there is no ";
        if (rows[i].warns) assert_non_null(strstr(warned, open));
        if (rows[i].warns) /* SICK's passwords are the same for all devices of a model */
            assert_string_equal(strstr(warned, open) + strlen(open),
                                rows[i].protocol == PROTOCOL_COLA ? "secret password" : "password");
        loop_free(loop);
    }
    rig_close(rig);
}

/* Position packets and settings name the receiver of the first link with data packets. */
static void protocols_know_the_head_and_its_data_link(void **state)
{
    (void)state;
    struct rig *rig = rig_open(NULL, NULL, 0);
    struct config *cfg = rig->cfg;
    struct sh_err err;
    strcpy(cfg->profile.firmware, "1.2.3");
    strcpy(cfg->head.serial, "SN-7");
    strcpy(cfg->head.name, "gate");
    cfg->profile.spin_up_s = 0.3;
    cfg->loop.queue_ms = 1500;
    cfg->profile.arrangement.n_geometries = 2;
    cfg->profile.arrangement.geometry[0].lines_uhz = 15000000;
    cfg->profile.arrangement.geometry[0].steps_per_turn = 1080;
    cfg->profile.arrangement.geometry[1].lines_uhz = 25000000;
    cfg->profile.arrangement.geometry[1].steps_per_turn = 720;
    cfg->n_links = 6;
    cfg->link[0] = (struct link_spec){.type = LINK_UDP, .protocol = PROTOCOL_VELODYNE, .port = 4001};
    cfg->link[1] = (struct link_spec){.type = LINK_UDP, .protocol = PROTOCOL_VELODYNE, .port = 4002};
    cfg->link[2] = (struct link_spec){.type = LINK_UDP, .protocol = PROTOCOL_VELODYNE_POSITION, .port = 9};
    cfg->link[3] = (struct link_spec){.type = LINK_NULL, .protocol = PROTOCOL_VELODYNE, .port = 4003};
    cfg->link[4] = (struct link_spec){.type = LINK_UDP, .protocol = PROTOCOL_VELODYNE_POSITION, .port = 10};
    cfg->link[5] = (struct link_spec){.type = LINK_NULL, .protocol = PROTOCOL_VELODYNE_POSITION, .port = 11};
    strcpy(cfg->link[0].address, "127.0.0.2");
    strcpy(cfg->link[1].address, "127.0.0.3");
    struct loop *loop = open_links(cfg, &err);
    if (loop == NULL) fail_msg("%s", err.text);
    const struct links *links = &loop->links;
    assert_string_equal(links->data_address, "127.0.0.2");
    assert_int_equal(links->data_port, 4001);
    assert_int_equal(links->position_port, 9);
    const struct protocol_identity *id = &links->identity;
    assert_string_equal(id->maker, "Maker");
    assert_string_equal(id->model, "Model");
    assert_string_equal(id->firmware, "1.2.3");
    assert_string_equal(id->serial, "SN-7");
    assert_string_equal(id->name, "gate");
    assert_int_equal(id->n_geometries, 2);
    assert_true(id->geometry[0].lines_uhz == 15000000 && id->geometry[0].steps == 1080);
    assert_true(id->geometry[1].lines_uhz == 25000000 && id->geometry[1].steps == 720);
    assert_true(id->spin_up_ns == 300000000 && id->queue_ns == 1500000000);
    assert_null(id->fields);
    loop_free(loop);
    cfg->n_fields = cfg->n_inputs = 1;
    cfg->field[0].number = 1;
    loop = open_links(cfg, &err);
    if (loop == NULL) fail_msg("%s", err.text);
    assert_ptr_equal(loop->links.identity.fields, &loop->links.fields);
    loop_free(loop);
    rig_close(rig);
}

/* A USB link at full speed carries 19 packets of 64 bytes each ms (USB 2.0, table 5-9). The head fires 300 kHz in a
 * turn of 360 deg by 3 facets with a gain of 2, and 100 deg of the 240 of a sweep are cast: 125,000 points a second. */
static void what_a_link_carries_is_compared(void **state)
{
    (void)state;
    static const struct {
        int attributes;
        enum colour_mode colour;
        int bytes; /* of a point */
        const char *advice;
    } rows[] = {{0, COLOUR_NONE, 20, "lower head.prr_hz to 145920"},
                {1, COLOUR_SOLID, 20 + NATIVE_ATTRIBUTE_LEN + NATIVE_COLOUR_LEN, "or leave out output.attributes"},
                {0, COLOUR_SOLID, 20 + NATIVE_COLOUR_LEN, "or leave out output.colour"}};
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct rig *rig = rig_open(NULL, NULL, 0);
        struct config *cfg = rig->cfg;
        const struct loop_options options = {.report = &report};
        struct loop *loop = NULL;
        struct sh_err err = {0};
        char text[128];
        cfg->n_links = 1;
        cfg->link[0] =
            (struct link_spec){.type = LINK_USB, .backend = USB_BACKEND_USBIP, .speed = USB_RATE_FULL, .vid = 1};
        cfg->output.attributes = rows[i].attributes;
        cfg->output.colour = rows[i].colour;
        assert_int_equal(loop_create(rig->site, rig->device, &options, &loop, &err), SH_EINPUT);
        snprintf(text, sizeof text, ": the stream has %.2f MB/s, the link carries 1.22 MB/s; lower head.prr_hz to ",
                 0.125 * rows[i].bytes);
        if (strstr(err.text, text) == NULL || strstr(err.text, rows[i].advice) == NULL) fail_msg("%s", err.text);
        assert_int_equal(strncmp(err.text, "link usbip:127.0.0.1:", 21), 0);
        assert_null(loop);
        if (i == 0) { /* no rate of the profile is low enough */
            cfg->profile.prr_min_uhz = 200000000000;
            assert_int_equal(loop_create(rig->site, rig->device, &options, &loop, &err), SH_EINPUT);
            assert_non_null(strstr(err.text, "; no rate of the head is low enough; allowed is a faster link"));
            assert_null(open_links(cfg, &err)); /* of a recording */
            assert_non_null(strstr(err.text, "; allowed is 0.48 times this speed, or another link"));
        }
        cfg->link[0].protocol = PROTOCOL_NMEA; /* not compared */
        need(loop_create(rig->site, rig->device, &options, &loop, &err), &err);
        loop_free(loop);
        rig_close(rig);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_link_that_others_reach_is_warned_of),
        cmocka_unit_test(protocols_know_the_head_and_its_data_link),
        cmocka_unit_test(what_a_link_carries_is_compared),
    };
    return cmocka_run_group_tests_name("links", tests, make_folder, remove_folder);
}
