# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The page of topics and services lists all interfaces of the node, and nothing else."""

import re

from checkout import CHECKOUT, needs_checkout
import pytest

from ur_cartesian_driver.ros.message_fields import class_of

PAGE = CHECKOUT / 'doc' / 'ros_interface.md'
pytestmark = [
    pytest.mark.slow,
    needs_checkout,
]

#: What every node has, and what belongs to the action.
OF_RCLPY = re.compile(
    r'/rosout|/parameter_events|.*/(describe|get|list|set)_param.*|'
    r'.*/get_type_description|.*/_action/.*'
)


def written(heading):
    """Return name -> type of the table below a heading."""
    section = PAGE.read_text().split(f'\n## {heading}\n')[1].split('\n## ')[0]
    rows = re.findall(r'^\| `([^`]+)` \| (\w+(?:/\w+)*)', section, re.MULTILINE)
    return {
        re.sub('^~', '/ur_cartesian_driver', name if name[0] in '~/' else f'/{name}'): kind.split(
            '/'
        )[-1]
        for name, kind in rows
    }


def there(names_and_types):
    return {
        name: types[0].split('/')[-1]
        for name, types in names_and_types
        if not OF_RCLPY.fullmatch(name)
    }


def test_all_topics_are_on_the_page(single_cell):
    node = single_cell.node
    topics = written('Topics')
    if class_of('tf2_msgs/msg/TFMessage') is None:
        assert topics.pop('/tf') == 'TFMessage'
    assert topics == there(
        node.get_publisher_names_and_types_by_node(node.get_name(), node.get_namespace())
    )


def test_all_services_are_on_the_page(single_cell):
    node = single_cell.node
    assert written('Services') == there(
        node.get_service_names_and_types_by_node(node.get_name(), node.get_namespace())
    )


@pytest.mark.parametrize('enabled', [False, True])
def test_nobody_listens_to_targets_unasked(sim, make_cell, enabled):
    node = make_cell(sim, live_target_enabled=enabled).node
    topics = written('Subscribed topics')
    if not enabled:
        del topics['/ur_cartesian_driver/live_target']
    assert topics == {
        name: kind
        for name, kind in there(
            node.get_subscriber_names_and_types_by_node(node.get_name(), node.get_namespace())
        ).items()
        if not name.startswith('/tf')
    }
